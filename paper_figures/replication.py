"""The replication note, `replication.md`: `replication_template.md` with the numbers that the runs have left.

`python -m paper_figures.replication` takes the committed record of `make claims` (`verification/claims/claims.json`),
those of `make verify`, `make bench` and `make sensitivity`, the errata and the citation, and fills in the template's
`{{...}}`. A number is named by its claim and what is counted, `{{C01 | mean velocity at t = 0 (m/d) | .2f}}`, or "off"
for its difference from the printed one; `{{C15 | contradicted}}` says C15 and is refused where that is not the verdict.
"""

from __future__ import annotations

import json
import re
import textwrap
from collections.abc import Callable
from importlib import import_module
from pathlib import Path

from paper_figures import FIGURES, manifest, overview
from paper_figures.claims import STATEMENTS
from repro.results import write_text
from verification import sensitivity, speed
from verification.bench import runs
from verification.bench.record import points
from verification.claims import (
    CHANGED,
    CONTRADICTED,
    FAILS,
    HOLDS,
    PREDICTED,
    REACHES_OVER,
    REPRODUCED,
    UNDECIDED,
    VERDICTS,
    WITHIN_ROUNDING,
    after_contact,
)
from verification.claims import report as claims_record
from verification.evidence.writing import markdown_row
from verification.sensitivity.wide import LEFT_OUT, verdicts

HERE = Path(__file__).parent
ROOT = HERE.parent
NOTE, TEMPLATE = (HERE / name for name in ("replication.md", "replication_template.md"))
REPORT = ROOT / "verification" / "report"
FIELD = re.compile(r"\{\{(.+?)\}\}")
#: What verdicts are called in the template; and what is told of a claim that has one.
NAMES = dict(zip(VERDICTS, ("reproduced", "rounding", "changed", "contradicted", "undecided")))
WHY = {WITHIN_ROUNDING: (("As printed", "reason"), ("Inputs", "rounding")), CHANGED: (("Changed", "change"),),
       CONTRADICTED: (("Why not", "reason"),), UNDECIDED: (("Why", "reason"),)}
WIDTH = 120


def told() -> dict:
    """What the note is made of: the committed claims, and the environment of the committed figures."""
    environment = json.loads(manifest.COMMITTED.read_text(encoding="utf-8"))["environment"]
    return {"environment": environment, "claims": claims_record.read()}


def fields(known: dict) -> dict[str, Callable[[], str]]:
    """What each name of the template without a claim stands for."""
    claims = known["claims"]
    return {**_about(), **_verdicts(claims), **_bench(), **_errata(),
            "verify": _verified, "audit.defaults": _of_defaults, **_supplies(),
            "list.flips": lambda: _flips(claims), "after.contact": lambda: _after_contact(claims),
            "base.bars": lambda: _bars_of_base(claims),
            "inputs.share": lambda: f"{100 * sensitivity.record()['one_set']['share_of_the_rounding']:.0f}",
            "table.values": lambda: "\n".join(map(_value, _printed(claims))),
            "overview.claims": lambda: "; ".join(f"{claim['id']} {claim['verdict']}" for claim in claims
                                                 if claim["id"] in overview.CLAIMS),
            "table.figures": lambda: "\n".join(map(_figure, FIGURES)),
            "environment": lambda: _environment(known["environment"])}


def _supplies() -> dict[str, Callable[[], str]]:
    """What other supplies make of Figure 6."""
    found = sensitivity.record()["supplies"]
    supplies, times = list(map(float, found)), [known["contact_time"] for known in found.values()]
    every, some, none = verdicts(found)
    return {"supplies.range": lambda: f"{min(supplies):g} to {max(supplies):g}",
            "supplies.contact": lambda: f"{max(times):.0f} to {min(times):.0f}",
            "supplies.total": lambda: str(len(every + some + none)), "supplies.all": lambda: str(len(every)),
            "supplies.some": lambda: str(len(some)), "supplies.none": lambda: str(len(none)),
            "supplies.left_out": lambda: "; ".join(f"{id}, which {why}" for id, why in LEFT_OUT.items()),
            "list.supplies": lambda: _which(every, some, none)}


def _which(every: list[str], some: list[str], none: list[str]) -> str:
    return "\n".join(f"- with {what}: {', '.join(ids) or 'none'}." for what, ids in
                     (("all of these supplies", every), ("some", some), ("none, as with 10 K_s", none)))


def _flips(claims: list[dict]) -> str:
    """Verdicts that a bound moved by its bar changes."""
    found = [(claim, flip) for claim in claims for flip in claims_record.flips(claim)]
    return "\n".join(f"- **{flip.id}**, {flip.quantity}: {claim['verdict']}, and {flip.verdict} with a bound moved."
                     for claim, flip in found) or "None."


def _after_contact(claims: list[dict]) -> str:
    """How well numbers after contact are known."""
    means = [known for known in sensitivity.record()["after_contact"] if known["quantity"].startswith("mean")]
    told = "; ".join(f"{known['quantity'].partition(' (')[0]} to {known['bar_percent']:.2g} % "
                     f"({known['asked_percent']:g} % asked)" for known in means)
    found = after_contact.known(claims)
    over = [each for each in found if each.percent > after_contact.WIDE_BAR]
    listed = "; ".join(f"{each.id}, {each.quantity}, {each.percent:.2g} %" for each in over)
    return (f"After contact wide is known, from contact to its end: {told}. Of the {len(found)} numbers after contact "
            f"that claims are judged by, the bars of {len(over)} exceed {after_contact.WIDE_BAR:g} % of the number: "
            f"{listed}.")


def _bars_of_base(claims: list[dict]) -> str:
    """Which numbers of base are known less well than its velocities and effluents, and why."""
    kinds = "; ".join(f"{why} ({_ids(those)})" for why, those in after_contact.wide_bars_of_base(claims).items())
    return (f"Velocities, effluents, uptake and concentrations of Base are known to {after_contact.BASE_BAR:g} % or "
            f"better. Wider are the bars of numbers of other kinds: {kinds}.")


def _ids(of: list) -> str:
    """Those of the claims, each once."""
    return ", ".join(dict.fromkeys(each.id for each in of))


def _about() -> dict[str, Callable[[], str]]:
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8").partition("references:")[0]

    def value(key: str) -> str:
        return re.search(rf"^{key}: (.+)$", citation, re.M)[1].strip('"')
    return {"authors": lambda: ", ".join(re.findall(r"^  - name: (.+)$", citation, re.M)),
            "version": lambda: value("version"), "licence": lambda: value("license")}


def _with(claims: list[dict], verdict: str) -> list[dict]:
    """Claims of a verdict."""
    return [claim for claim in claims if claim["verdict"] == verdict]


def _verdicts(claims: list[dict]) -> dict[str, Callable[[], str]]:
    outcomes = [check["outcome"] for _, check in _predicted(claims)]
    counts = {f"claims.{name}": lambda verdict=verdict: str(len(_with(claims, verdict)))
              for verdict, name in NAMES.items()}
    lists = {f"list.{name}": lambda verdict=verdict: "\n".join(map(_entry, _with(claims, verdict))) or "None."
             for verdict, name in NAMES.items()}
    return {**counts, **lists, "claims.total": lambda: str(len(claims)), "paper.total": lambda: str(len(outcomes)),
            "paper.within": lambda: str(outcomes.count(HOLDS)), "paper.outside": lambda: str(outcomes.count(FAILS)),
            "paper.open": lambda: str(outcomes.count(REACHES_OVER))}


def _printed(claims: list[dict]) -> list[tuple[dict, dict]]:
    """(claim, check) of every number that the paper prints a value of."""
    return [(claim, check) for claim in claims for check in claim["checks"] if check["paper_low"] is not None]


def _predicted(claims: list[dict]) -> list[tuple[dict, dict]]:
    """Those of them that take a solution to know."""
    return [(claim, check) for claim, check in _printed(claims) if check["rests_on"] == PREDICTED]


def _value(pair: tuple[dict, dict]) -> str:
    claim, check = pair
    widths = [_span(check["paper_low"], check["paper_high"]), f"{check['value']:.4g}",
              _span(check["low"], check["high"]), _span(check["input_low"], check["input_high"]),
              _span(*(check["scheme_2001"] or (None, None)))]
    rests = "" if check["rests_on"] == PREDICTED else f" ({check['rests_on']})"
    return markdown_row((claim["id"], check["quantity"], f"{check['paper']}: {widths[0]}", *widths[1:],
                         f"{check['outcome']}{rests}"))


def _span(low: float | None, high: float | None) -> str:
    return "-" if low is None or high is None else f"{low:.4g} to {high:.4g}"


def _entry(claim: dict) -> str:
    """A claim in the list of its verdict, with what is told of that."""
    check = claim["checks"][0]
    words = ([f"Here: {check['quantity']}, {check['value']:.4g}"] if claim["verdict"] == REPRODUCED else
             [f"*{word}:* {claim[key].rstrip('.')}" for word, key in WHY[claim["verdict"]]])
    return ". ".join((f"- **{claim['id']}** ({claim['where']}): {claim['claim']}", *words)) + "."


def _figure(name: str) -> str:
    """A row of the table of figures; what is no claim of the paper's is its caption's to say."""
    module = import_module(f"paper_figures.{name}")
    kind, _, title = module.TITLE.partition(". ")
    what = "; ".join(f"{STATEMENTS[claim]} ({claim})" for claim in module.CLAIMS)
    printed = "not in the paper" if kind == "Addition" else kind
    return markdown_row((f"{printed}: {title}", f"`out/{name}.pdf`", what))


def _kept(name: str) -> dict:
    return json.loads((REPORT / name).read_text(encoding="utf-8"))


def _verified() -> str:
    """How many cases pass, as the report says it."""
    report = (REPORT / "REPORT.md").read_text(encoding="utf-8")
    return re.search(r"^\*\*(\d+ of \d+ cases pass; \d+ numbers judged)", report, re.M)[1]


def _of_defaults() -> str:
    """The largest change (%) that the defaults which are not the paper's make over the base run."""
    ours = (("transport in time", "transient (Gear)"), ("transfer at a remesh", "linear"))
    changes = [abs(value) for row in _kept("audit.json")["rows"] if (row["choice"], row["alternative"]) in ours
               for value in row["effect"].values()]
    return f"{100 * max(changes):.1g}"


def _bench() -> dict[str, Callable[[], str]]:
    bench = _kept("bench.json")
    failed = [one for one in bench["verdicts"] if one["holds"] is not True]
    part = bench["parts"]["base"]
    fast, slow = points(part, runs.FAST)[0], speed.as_it_is(part)
    return {"bench.processor": lambda: f"one core ({bench['machine']['processor']})",
            "bench.paper": lambda: f"{slow['seconds']:.1f}", "bench.fast": lambda: f"{fast['seconds']:.1f}",
            "bench.error": lambda: f"{100 * fast['error']:.1f}", "bench.total": lambda: str(len(bench["verdicts"])),
            "bench.failed": lambda: str(len(failed)), "bench.verb": lambda: "does" if len(failed) == 1 else "do",
            "list.bench": lambda: "\n".join(f"- {one['claim']}: wanted {one['wanted']}, measured {one['measured']}."
                                            for one in failed)}


def _errata() -> dict[str, Callable[[], str]]:
    found = re.findall(r"^## (E\d+)\. (.+)$", (ROOT / "reference" / "ERRATA.md").read_text(encoding="utf-8"), re.M)
    return {"errata.count": lambda: str(len(found)),
            "list.errata": lambda: "\n".join(f"- **{key}**: {title}." for key, title in found)}


def _environment(about: dict[str, str]) -> str:
    names = ("numpy", "scipy", "scikit-fem", "mmgpy", "shapely")
    return (f"Python {about['python']}, {', '.join(f'{name} {about[name]}' for name in names)}, {about['blas']} on "
            f"{about['system']} ({about['processor']})")


def filled(template: str, known: dict) -> str:
    """The note. Raises LookupError for a name, a claim or a quantity that there is not, or another verdict."""
    simple, claims = fields(known), {claim["id"]: claim for claim in known["claims"]}

    def value(found: re.Match) -> str:
        parts = [part.strip() for part in found[1].split("|")]
        if len(parts) > 1:
            return _of_claim(claims, *parts)
        return simple[parts[0]]()
    return "\n\n".join(map(_wrapped, FIELD.sub(value, template).split("\n\n")))


def _wrapped(block: str) -> str:
    """A paragraph, or each point of a list, in lines of WIDTH; headings, tables and the rest as they are."""
    if re.match(r"[#|!<]", block):
        return block
    points = re.split(r"\n(?=- |\d+\. )", block.strip("\n"))
    end = "\n" if block.endswith("\n") else ""
    return "\n".join(textwrap.fill(" ".join(point.split()), WIDTH, break_long_words=False, break_on_hyphens=False,
                                   subsequent_indent=" " * (re.match(r"(- |\d+\. )?", point).end()))
                     for point in points) + end


def _of_claim(claims: dict[str, dict], id: str, what: str, form: str = "") -> str:
    claim = claims[id]
    if not form:
        if claim["verdict"] != what:
            raise LookupError(f"{id} is {claim['verdict']}, not {what}")
        return id
    check = {check["quantity"]: check for check in claim["checks"]}[what]
    if form == "off":
        return f"{100 * abs(check['value'] / float(check['paper']) - 1):.2g} %"
    return format(check["value"], form)


def main() -> None:
    """Write the note."""
    write_text(NOTE, filled(TEMPLATE.read_text(encoding="utf-8"), told()))
    print(f"{NOTE}: written")


if __name__ == "__main__":
    main()
