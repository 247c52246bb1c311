"""The replication note, `replication.md`, and the register of the claims, `register.md`: their templates with the
numbers of the committed records.

`python -m paper_figures.replication` fills in the fields `{{...}}` of the templates from the committed records of `make
claims` (`verification/claims/claims.json`), `make verify`, `make bench` and `make sensitivity`, the errata and the
citation. A field names a claim and its quantity, `{{C01 | mean velocity at t = 0 (m/d) | .2f}}`; the format "off" gives
the difference from the printed number. `{{C15 | contradicted}}` gives C15 and fails if the verdict is another; `{{C64 |
dependence}}` says with what it holds.
"""

from __future__ import annotations

import csv
import json
import re
import textwrap
from collections.abc import Callable
from importlib import import_module
from pathlib import Path

from paper_figures import FIGURES, manifest
from paper_figures.claims import STATEMENTS
from repro.results import write_text
from verification import sensitivity, speed
from verification.bench import runs
from verification.bench.record import points
from verification.claims import (
    FAILS,
    HOLDS,
    NOT_JUDGED,
    PREDICTED,
    REACHES_OVER,
    VERDICTS,
    after_contact,
)
from verification.claims import report as claims_record
from verification.evidence.writing import markdown_row
from verification.sensitivity.wide import LEFT_OUT, verdicts

FOLDER = Path(__file__).parent
ROOT = FOLDER.parent
#: The texts, each with its template.
NOTE, REGISTER = (FOLDER / name for name in ("replication.md", "register.md"))
TEMPLATES = {text: text.with_stem(f"{text.stem}_template") for text in (NOTE, REGISTER)}
REPORT = ROOT / "verification" / "report"
FIELD = re.compile(r"\{\{(.+?)\}\}")
#: Names of the verdicts in the templates, and the parts of a claim that the register quotes beside its numbers.
NAMES = dict(zip(VERDICTS, ("reproduced", "rounding", "changed", "degree", "depends", "contradicted", "undecided",
                            "unjudged")))
WHY = {"Depends": "dependence", "Meaning taken back": "taken_back", "Changed": "change", "Why not": "reason",
       "Inputs": "rounding", "Note": "note", "Not varied": "fixed"}
WIDTH = 120


def read_records() -> dict:
    """Read the committed claims, and the environment of the committed figures."""
    environment = json.loads(manifest.COMMITTED.read_text(encoding="utf-8"))["environment"]
    return {"environment": environment, "claims": claims_record.read()}


def fields(known: dict) -> dict[str, Callable[[], str]]:
    """The text of each field of the template that names no claim."""
    claims = known["claims"]
    return {**_about(), **_verdicts(claims), **_bench(), **_errata(),
            "verify": _verified, "audit.defaults": _of_defaults, **_supplies(),
            "after.contact": lambda: _after_contact(claims),
            "base.bars": lambda: _bars_of_base(claims),
            "inputs.set": _set_of_inputs,
            "table.values": lambda: "\n".join(map(_value, _printed(claims))),
            "table.claims": lambda: "\n".join(map(_claim, claims)), "sentences": lambda: _sentences(claims),
            "table.figures": lambda: "\n".join(map(_figure, FIGURES)),
            "environment": lambda: _environment(known["environment"])}


def _set_of_inputs() -> str:
    """Whether one set of inputs gives all printed numbers of Base."""
    one_set = sensitivity.record()["one_set"]
    reached = "One" if one_set["reached"] else "No"
    return f"{reached} set of inputs within the rounding gives all printed numbers of Base: {sensitivity.impossible()}"


def _supplies() -> dict[str, Callable[[], str]]:
    """Fields on Figure 6 with other supplies."""
    supplies_record = sensitivity.record()["supplies"]
    supplies, times = list(map(float, supplies_record)), [known["contact_time"] for known in supplies_record.values()]
    every, some, none = verdicts(supplies_record)
    return {"supplies.range": lambda: f"{min(supplies):g} to {max(supplies):g}",
            "supplies.contact": lambda: f"{max(times):.0f} to {min(times):.0f}",
            "supplies.total": lambda: str(len(every + some + none)), "supplies.all": lambda: str(len(every)),
            "supplies.some": lambda: str(len(some)), "supplies.none": lambda: str(len(none)),
            "supplies.left_out": lambda: "; ".join(f"{id}, which {why}" for id, why in LEFT_OUT.items()),
            "list.supplies": lambda: _list_supplies(every, some, none)}


def _list_supplies(every: list[str], some: list[str], none: list[str]) -> str:
    return "\n".join(f"- with {label}: {', '.join(ids) or 'none'}." for label, ids in
                     (("all of these supplies", every), ("some", some), ("none, as with 10 K_s", none)))


def _after_contact(claims: list[dict]) -> str:
    """Sentence on the accuracy of numbers after contact."""
    means = [known for known in sensitivity.record()["after_contact"] if known["quantity"].startswith("mean")]
    precision = "; ".join(f"{known['quantity'].partition(' (')[0]} to {known['bar_percent']:.2g} % "
                     f"({known['asked_percent']:g} % required)" for known in means)
    numbers = after_contact.bars_after_contact(claims)
    wide = [number for number in numbers if number.percent > after_contact.WIDE_BAR]
    listed = "; ".join(f"{number.id}, {number.quantity}, {number.percent:.2g} %" for number in wide)
    return (f"The accuracy of Wide, from contact to its end, is: {precision}. Claims are judged by {len(numbers)} "
            f"numbers after contact. The bars of {len(wide)} exceed {after_contact.WIDE_BAR:g} % of the number: "
            f"{listed}.")


def _bars_of_base(claims: list[dict]) -> str:
    """Sentence on the numbers of Base that are less accurate than its velocities and effluents."""
    kinds = "; ".join(f"{why} ({_ids(those)})" for why, those in after_contact.wide_bars_of_base(claims).items())
    return (f"Velocities, effluents, uptake and concentrations of Base are known to {after_contact.BASE_BAR:g} % or "
            f"better. Numbers of other kinds have wider bars: {kinds}.")


def _ids(numbers: list) -> str:
    """The distinct ids of the numbers' claims."""
    return ", ".join(dict.fromkeys(number.id for number in numbers))


def _about() -> dict[str, Callable[[], str]]:
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8").partition("references:")[0]

    def value(key: str) -> str:
        return re.search(rf"^{key}: (.+)$", citation, re.M)[1].strip('"')
    return {"authors": lambda: ", ".join(re.findall(r"^  - name: (.+)$", citation, re.M)),
            "version": lambda: value("version"), "licence": lambda: value("license")}


def _verdicts(claims: list[dict]) -> dict[str, Callable[[], str]]:
    """Counts of the verdicts, of the claims that had another one before, and of the printed values."""
    outcomes = [*claims_record.distinct(claims).values()]
    counts = {f"claims.{name}": lambda ids=[claim["id"] for claim in claims if claim["verdict"] == verdict]:
              str(len(ids)) for verdict, name in NAMES.items()}
    lists = {f"ids.{name}": lambda ids=[claim["id"] for claim in claims if claim["verdict"] == verdict]:
             ", ".join(ids) or "none" for verdict, name in NAMES.items()}
    return {**counts, **lists, "claims.former": lambda: str(sum(map(_had_another, claims))),
            "claims.total": lambda: str(len(claims)), "paper.total": lambda: str(len(outcomes)),
            "paper.within": lambda: str(outcomes.count(HOLDS)), "paper.outside": lambda: str(outcomes.count(FAILS)),
            "paper.open": lambda: str(outcomes.count(REACHES_OVER))}


def _printed(claims: list[dict]) -> list[tuple[dict, dict]]:
    """(claim, check) of every number whose value the paper prints."""
    return [(claim, check) for claim in claims for check in claim["checks"] if check["paper_low"] is not None]


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


def _claim(claim: dict) -> str:
    """A row of the register: a claim with its verdict, its numbers and their widths, the meanings of its words, the
    thresholds at which its bounds flip, and all verdicts that it had before, with the numbers of other definitions."""
    words = []
    if len(claim["meanings"]) > 1:
        words.append(f"*Meanings:* {'; '.join(map(claims_record.meaning_text, claim['meanings']))}")
    if claim["flips"]:
        words.append(f"*Thresholds:* {'; '.join(map(claims_record.flip_text, claim['flips']))}")
    words += [f"*{word}:* {claim[key]}" for word, key in WHY.items() if claim.get(key)]
    if claim["former"]:
        words.append(f"*Former verdicts:* {claims_record.former_text(claim)}")
    for each in claim["other_definitions"]:
        numbers = "; ".join(map(_number, each["checks"]))
        words.append(f"*Defined on {each['defined']}* ({each['words']}): {each['verdict']}; {numbers}")
    return markdown_row((f"**{claim['id']}**", claim["where"], claim["claim"], claim["verdict"],
                         "<br>".join(map(_number, claim["checks"])) or "-", "<br>".join(words) or "-"))


def _number(check: dict) -> str:
    """A number of a claim with its widths and its outcome."""
    accepted = claims_record.interval_text(claims_record.ends(check["tolerance"]))
    widths = {"numerics": (check["low"], check["high"]),
              "inputs": (check.get("input_low"), check.get("input_high")),
              "scheme of 2001": check.get("scheme_2001") or (None, None)}
    spans = [f"{name} {_span(*pair)}" for name, pair in widths.items() if None not in pair]
    here = " ".join([claims_record.value_text(check["value"], check["high"]), f"({'; '.join(spans)})" if spans else ""])
    return f"{check['quantity']}: paper {check['paper']}, here {here.strip()}; accepted {accepted}: {check['outcome']}"


def _sentences(claims: list[dict]) -> str:
    """How many sentences and fragments of the paper the table quotes, how many nothing judges, and how many are only
    drawn. A row that rests on claims that are not judged is not judged."""
    with (ROOT / "verification" / "claims" / "sentences.csv").open(encoding="utf-8", newline="") as lines:
        rows = [row["covered"].split() for row in csv.DictReader(lines)]
    unjudged = {claim["id"] for claim in claims if claim["verdict"] == NOT_JUDGED}
    drawn = sum(bool(names) and set(names) <= set(FIGURES) for names in rows)
    return (f"{len(rows)} sentences and fragments, {sum(set(names) <= unjudged for names in rows)} of them not judged "
            f"and {drawn} only drawn")


def _had_another(claim: dict) -> bool:
    """Whether a claim had another verdict before."""
    return any(each["verdict"] != claim["verdict"] for each in claim["former"])


def _figure(name: str) -> str:
    """A row of the table of figures, with the paper's claims."""
    module = import_module(f"paper_figures.{name}")
    kind, _, title = module.TITLE.partition(". ")
    statements = "; ".join(f"{STATEMENTS[claim]} ({claim})" for claim in module.CLAIMS)
    printed = "not in the paper" if kind == "Addition" else kind
    return markdown_row((f"{printed}: {title}", f"`out/{name}.pdf`", statements))


def _read_record(name: str) -> dict:
    return json.loads((REPORT / name).read_text(encoding="utf-8"))


def _verified() -> str:
    """The number of cases that pass, from the report."""
    report = (REPORT / "REPORT.md").read_text(encoding="utf-8")
    return re.search(r"^\*\*(\d+ of \d+ cases pass; \d+ numbers judged)", report, re.M)[1]


def _of_defaults() -> str:
    """The largest change (%) over the base run by the defaults that differ from the paper, except the carrier."""
    switches = (("transport in time", "transient (Gear)"), ("transfer at a remesh", "linear"),
                ("inlet condition (11)", "u_ave"))
    rows = [row for row in _read_record("audit.json")["rows"] if (row["choice"], row["alternative"]) in switches]
    changes = [abs(value) for row in rows for value in row["effect"].values()]
    return f"{100 * max(changes):.1g}"


def _bench() -> dict[str, Callable[[], str]]:
    bench = _read_record("bench.json")
    failed = [verdict for verdict in bench["verdicts"] if verdict["holds"] is not True]
    part = bench["parts"]["base"]
    fast, slow = points(part, runs.FAST)[0], speed.paper_point(part)
    return {"bench.processor": lambda: f"one core ({bench['machine']['processor']})",
            "bench.paper": lambda: f"{slow['seconds']:.1f}", "bench.fast": lambda: f"{fast['seconds']:.1f}",
            "bench.error": lambda: f"{100 * fast['error']:.1f}", "bench.total": lambda: str(len(bench["verdicts"])),
            "bench.failed": lambda: str(len(failed)), "bench.verb": lambda: "does" if len(failed) == 1 else "do",
            "list.bench": lambda: "\n".join(
                f"- {verdict['claim']}: expected {verdict['wanted']}, measured {verdict['measured']}."
                for verdict in failed)}


def _errata() -> dict[str, Callable[[], str]]:
    errata = re.findall(r"^## (E\d+)\. (.+)$", (ROOT / "reference" / "ERRATA.md").read_text(encoding="utf-8"), re.M)
    return {"errata.count": lambda: str(len(errata)),
            "list.errata": lambda: "\n".join(f"- **{key}**: {title}." for key, title in errata)}


def _environment(about: dict[str, str]) -> str:
    names = ("numpy", "scipy", "scikit-fem", "mmgpy", "shapely")
    return (f"Python {about['python']}, {', '.join(f'{name} {about[name]}' for name in names)}, {about['blas']} on "
            f"{about['system']} ({about['processor']})")


def fill_template(template: str, known: dict) -> str:
    """Fill in the template. Raises LookupError for an unknown name, claim or quantity, or for another verdict."""
    simple, claims = fields(known), {claim["id"]: claim for claim in known["claims"]}

    def value(match: re.Match) -> str:
        parts = [part.strip() for part in match[1].split("|")]
        if len(parts) > 1:
            return _of_claim(claims, *parts)
        return simple[parts[0]]()
    return "\n\n".join(map(_wrap, FIELD.sub(value, template).split("\n\n")))


def _wrap(block: str) -> str:
    """Wrap a paragraph, or each item of a list, to WIDTH; headings, tables and comments stay unchanged."""
    if re.match(r"[#|!<]", block):
        return block
    points = re.split(r"\n(?=- |\d+\. )", block.strip("\n"))
    end = "\n" if block.endswith("\n") else ""
    return "\n".join(textwrap.fill(" ".join(point.split()), WIDTH, break_long_words=False, break_on_hyphens=False,
                                   subsequent_indent=" " * (re.match(r"(- |\d+\. )?", point).end()))
                     for point in points) + end


def _of_claim(claims: dict[str, dict], id: str, quantity: str, form: str = "") -> str:
    claim = claims[id]
    if quantity == "dependence":
        return claim["dependence"]
    if not form:
        verdict = claim["verdict"]
        if verdict != quantity:
            raise LookupError(f"{id} is {verdict}, not {quantity}")
        return id
    check = {check["quantity"]: check for check in claim["checks"]}[quantity]
    if form == "off":
        return f"{100 * abs(check['value'] / float(check['paper']) - 1):.2g} %"
    return format(check["value"], form)


def main() -> None:
    """Write the replication note and the register."""
    known = read_records()
    for text, template in TEMPLATES.items():
        write_text(text, fill_template(template.read_text(encoding="utf-8"), known))
        print(f"{text}: written")


if __name__ == "__main__":
    main()
