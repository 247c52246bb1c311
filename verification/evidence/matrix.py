"""The coverage matrix: ``python -m verification.evidence.matrix`` writes ``verification/report/matrix.md``.

The first table lists the elements and presets that each case runs with. The second lists the paper's equations with the
modules that solve them, the cases that must fail after a wrong change of these modules, the references of these cases,
and the claims of the sections. Every column is derived from the table of modules in ``repro/__init__.py`` and the
registries, and no column may lack an entry (:func:`orphans`).
"""

import re
import sys
from dataclasses import dataclass
from functools import cache
from itertools import product, starmap

import repro
from verification.evidence.cases import NUMERICS, Case, cases
from verification.evidence.writing import REPORT, ROOT, page, table
from verification.mutants import runner

FILE = REPORT / "matrix.md"
ORDERS, PRESETS = NUMERICS[:2], NUMERICS[2:]
#: Why a case does not run with presets, or not with all of them.
ALONE = "presets: the stage alone, with the elements that they choose"
ONE_BY_ONE = "other presets: their elements, by themselves"
#: Why cases of a stage that run with accurate do not run with exact, unless the case gives its own reason.
SAME = "exact: the elements and the order of accurate"
EXACT = {"flow": SAME, "transport": SAME,
         "hard": "exact: the scheme of accurate, and some times slower; its contact and remeshes: "
                 "growth-gold-contact, coupling-ledger"}
#: A line of the table: sections and words, equations, modules, and a remark.
LINE = re.compile(r"^ {4,}(\S.*?)\s{3,}((?:\(\d+\)[-, ]*)+)?\s*(repro\.[\w.]+(?:, (?:repro)?\.\w+)*)(?:[: ].*)?$")
#: The sections at the start of its first part: "3.1, 3.5", "2.1-2.3".
SECTIONS = re.compile(r"(?:Table 1|[\d.]+(?:-[\d.]+)?|, )*")
#: An import of a module of ``reference``.
REFERENCE = re.compile(r"^\s*from reference(?:\.(\w+))? import (.+)$", re.M)


@dataclass(frozen=True)
class Part:
    """A line of the table of modules: "2.1, 3.2 flow", its sections, "(1)-(6)", and files."""

    name: str
    sections: tuple[str, ...]
    equations: str
    files: tuple[str, ...]


@cache
def parts() -> tuple[Part, ...]:
    """The table of modules that ``repro/__init__.py`` has."""
    head = (repro.__doc__ or "").partition("Where data enters")[0]
    return tuple(_part(*match.groups("")) for match in map(LINE.match, head.splitlines()) if match)


def _part(name: str, equations: str, names: str) -> Part:
    first, *rest = names.split(", ")
    package = first if _file(first).endswith("/") else first.rpartition(".")[0]
    files = _file(first), *(_file(name if name.startswith("repro") else package + name) for name in rest)
    places = SECTIONS.match(name)[0].split(", ")
    sections = tuple(section for place in places for section in _ranged(place) if section)
    return Part(" ".join(name.split()), sections, equations.strip(" ,"), files)


def _ranged(place: str) -> list[str]:
    """["2.1", "2.2", "2.3"] of "2.1-2.3"."""
    first, _, last = place.partition("-")
    if not last:
        return [first]
    chapter, low = first.split(".")
    return [f"{chapter}.{number}" for number in range(int(low), int(last.split(".")[1]) + 1)]


def _file(module: str) -> str:
    """A module's file; a package's folder."""
    path = module.replace(".", "/")
    return f"{path}/" if (ROOT / path).is_dir() else f"{path}.py"


def row(case: Case) -> tuple[str, ...]:
    """A line of the first table."""
    return (case.id, *(_cell(case, name) for name in NUMERICS), reasons(case))


def _cell(case: Case, name: str) -> str:
    """Whether a case runs with the numerics of a name."""
    if name not in case.numerics:
        return "n/a"
    return "run" if name in case.quick_numerics else "slow"


def reasons(case: Case) -> str:
    """Why a case does not run with the other numerics; "" if it runs with all."""
    missing = _unexplained_presets(case)
    default = ONE_BY_ONE if missing else ""
    if missing == PRESETS:
        default = ALONE
    elif _exact_alone(case):
        default = EXACT.get(case.stage, "")
    return "; ".join(filter(None, (case.omitted, default)))


def _unexplained_presets(case: Case) -> tuple[str, ...]:
    """The presets that the case neither runs with nor mentions in ``omitted``."""
    return tuple(preset for preset in PRESETS if preset not in case.numerics and preset not in case.omitted)


def _exact_alone(case: Case) -> bool:
    """Whether the case runs with accurate and ``omitted`` mentions all presets except exact."""
    return "accurate" in case.numerics and _unexplained_presets(case) == ("exact",)


def unexplained() -> list[str]:
    """Cases that do not run with an order of elements, with nothing at all, or with accurate and not with exact, and do
    not say why."""
    return [case.id for case in cases().values()
            if not case.numerics or ({*ORDERS} - {*case.numerics} and not case.omitted)
            or (_exact_alone(case) and case.stage not in EXACT)]


def line(part: Part) -> tuple[str, ...]:
    """A line of the second table."""
    modules = [file.removeprefix("repro/") for file in part.files]
    columns = (modules, cases_of(part), references_at(part), mutants_of(part), claims_of(part))
    return (part.name, part.equations, *(", ".join(column) or "-" for column in columns))


def mutants_of(part: Part) -> list[str]:
    """Ids of the wrong changes to its files."""
    return [id for id, mutant in runner.mutants_by_id().items() if mutant.file.startswith(part.files)]


def cases_of(part: Part) -> list[str]:
    """Ids of the cases that name one of its mutants."""
    mutants = {*mutants_of(part)}
    return [case.id for case in cases().values() if mutants & {*case.mutants}]


def references_at(part: Part) -> list[str]:
    """Modules of ``reference`` that its cases use."""
    return sorted({name for id in cases_of(part) for name in references_of(cases()[id])})


def claims_of(part: Part) -> list[str]:
    """Ids of the claims of its sections."""
    return [id for id, sections in sorted(claims().items())
            if any(starmap(_within, product(sections, part.sections)))]


def _within(section: str, section_name: str) -> bool:
    return section == section_name or section.startswith(f"{section_name}.")


@cache
def claims() -> dict[str, list[str]]:
    """{claim: its sections}."""
    from verification.claims import CLAIMS, evaluate
    evaluate.register_all()
    return {claim.id: [*map(_section, claim.where.split(","))] for claim in CLAIMS.values()}


def _section(place: str) -> str:
    """The number of a section. Figures, plates, introduction and discussion count as section 4."""
    return place.strip() if re.fullmatch(r"[23][\d.]*|Table 1", place.strip()) else "4"


def references_of(case: Case) -> set[str]:
    """The modules of ``reference`` that a case names, and those that they import."""
    return {*case.references}.union(*map(_imported, case.references))


def _imported(name: str) -> set[str]:
    """The modules of ``reference`` that one of them imports."""
    imports = REFERENCE.findall((ROOT / "reference" / f"{name}.py").read_text(encoding="utf-8"))
    return {module for package, names in imports for module in ([package] if package else names.split(", "))}


def orphans() -> list[str]:
    """Cases, references, claims, and mutants of cases that the second table lacks; and its lines without a case."""
    missing = [f"line {part.name}" for part in parts() if not cases_of(part)]
    references = {path.stem for path in (ROOT / "reference").glob("*.py")} - {"__init__"}
    kinds = {"case": (cases(), cases_of), "mutant": (runner.caught_by("cases"), mutants_of),
             "claim": (claims(), claims_of), "reference": (references, references_at)}
    for kind, (known, ids_of) in kinds.items():
        missing += [f"{kind} {id}" for id in sorted({*known}.difference(*map(ids_of, parts())))]
    return missing


def text() -> str:
    """The page: both tables."""
    head = ("section", "equations", "modules", "cases", "references", "mutants", "claims")
    blocks = ["## Elements and presets",
              "run: with every `make verify-fast`; slow: with `make verify`; n/a: not applicable.",
              table(("case", *NUMERICS, "not applicable because"), map(row, cases().values())),
              "## Equation, module, case, reference, mutant, claim", table(head, map(line, parts()))]
    return page("What is verified by what, with which elements and presets", blocks)


def main() -> int:
    """Write the page and print the missing entries; return 1 if there are any."""
    FILE.write_text(text(), encoding="utf-8")
    missing = [*orphans(), *(f"case {id}: not with every order, and no reason why" for id in unexplained())]
    print("\n".join([*missing, f"{FILE.relative_to(ROOT)}: {len(cases())} cases, {len(missing)} missing"]))
    return 1 if missing else 0


if __name__ == "__main__":
    sys.exit(main())
