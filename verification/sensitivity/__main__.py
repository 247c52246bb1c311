"""`python -m verification.sensitivity [--only PART]`: effects of the rounding of inputs, with pictures and a page.

The parts are base and wide, their elasticities and the one set of inputs; after_contact, the accuracy of wide after
contact; supplies, the claims about wide that hold with other supplies; and sobol, indices of base.

Each run is stored in `out/runs.jsonl` when it ends; a second call resumes from that file."""

import argparse
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from repro.results import write_json, write_text
from verification import sensitivity
from verification.claims import interval
from verification.evidence import writing
from verification.evidence.writing import saved_figure, table
from verification.sensitivity import rounding, wide
from verification.sensitivity.rounding import INPUTS, ROUNDED, Input, Runs, load_varied

TARGET, OUTLINES = (Path(__file__).parent / name for name in ("tornado.svg", "supplies.svg"))
NAMES = {"velocity_0": "mean velocity, t = 0", "velocity": "mean velocity, 19.2 h",
         "effluent_acceptor": "effluent acceptor, 19.4 h", "effluent_donor": "effluent donor, 19.4 h",
         "contact_time": "time of contact (wide)", "conductivity_after": "conductivity 4 h after contact (wide)"}
UP, DOWN = "#D55E00", "#0072B2"
UNMOVED = "no rounding of an input changes it"
#: Width of wide (um).
WIDTH = 100.0


def reaches(record: dict, number: str) -> list[tuple[str, float, bool]]:
    """(input, effect (%) of half a unit of its last digit on a number, whether it is resolved), the largest effect
    first."""
    elasticities = record["elasticities"][number]
    changes = [(parameter.name, 100 * elasticities[parameter.name]["elasticity"] * parameter.rounding,
                elasticities[parameter.name]["resolved"]) for parameter in ROUNDED]
    return sorted(changes, key=lambda row: -abs(row[1]))


def write(record: dict, target: Path = TARGET, outlines: Path = OUTLINES) -> None:
    """Both pictures."""
    tornado(record, target)
    of_supplies(record["supplies"], outlines)


def of_supplies(by_supply: dict[str, dict], target: Path) -> None:
    """Draw the outlines of wide every 5 h, one supply per row, the latest at the back."""
    figure = Figure(figsize=(9, 1.7 * len(by_supply)), layout="constrained")
    for axes, (supply, result) in zip(figure.subplots(len(by_supply), sharex=True), by_supply.items()):
        *_, last = map(float, result["outlines"])
        for time, places in reversed(result["outlines"].items()):
            colour = matplotlib.colormaps["viridis_r"](float(time) / last)
            axes.fill(*_places(places).T, facecolor=colour, edgecolor="white")
        axes.set_ylim(0, WIDTH)
        axes.set_aspect("equal")
        axes.set_title(f"{supply} K_s: every 5 h to {last:g} h; contact at {result['contact_time']:.1f} h", loc="left",
                       fontsize=10)
    axes.set_xlabel("x (um); the fluid comes from the left")
    saved_figure(figure, target)


def _places(text: str) -> np.ndarray:
    """(M, 2) um."""
    return np.array([pair.split(",") for pair in text.split()], float)


def tornado(record: dict, target: Path) -> None:
    """Draw for each number the effect of each input's last printed digit, up and down; hatched if not resolved."""
    lines = len(NAMES) // 2
    figure = Figure(figsize=(9, 2.6 * lines), layout="constrained")
    for axes, number in zip(figure.subplots(lines, 2).ravel(), NAMES):
        rows = [row for row in reaches(record, number)[:8] if row[1]]
        axes.set_title(NAMES[number], loc="left", fontsize=10)
        if not rows:
            axes.set_axis_off()
            axes.text(0.0, 0.85, UNMOVED, transform=axes.transAxes, fontsize=10)
            continue
        axes.set_xlabel("change (%)")
        axes.axvline(0, color="black", linewidth=0.8)
        for name, value, resolved in reversed(rows):
            _bars(axes, name, value, resolved)
    figure.suptitle("Half a unit of the last printed digit of an input: upwards (orange), downwards (blue); hatched: "
                    "not resolved", fontsize=10)
    saved_figure(figure, target)


def _bars(axes: Axes, name: str, value: float, resolved: bool) -> None:
    """Both bars of an input."""
    for change, colour in ((value, UP), (-value, DOWN)):
        look = {"color": colour} if resolved else {"facecolor": "none", "edgecolor": colour, "hatch": "////"}
        axes.barh(name, change, height=0.7, **look)


def page(record: dict) -> str:
    """The page of the record."""
    introduction = ("Elasticities d ln(number) / d ln(input), by central differences of the converged solution. ± is "
                    "the bar; an elasticity whose bar exceeds a tenth of it is *not resolved*. `make sensitivity` "
                    "writes this page.")
    blocks = [introduction, f"![Tornado diagram]({TARGET.name})", _table(record)]
    for part, section in SECTIONS.items():
        blocks += section(record[part])
    return writing.page("Effects of the rounding of Table 1", blocks) + "\n"


def _table(record: dict) -> str:
    elasticities = record["elasticities"]
    return table(("input", "rounding (%)", *map(_title_of, elasticities)),
                 (_row(parameter, elasticities) for parameter in INPUTS))


def _title_of(number: str) -> str:
    return NAMES.get(number, number.replace("_", " "))


def _row(parameter: Input, elasticities: dict[str, dict]) -> tuple[str, ...]:
    rounding = f"{100 * parameter.rounding:.2g}" if parameter.half else "exact"
    return (parameter.name, rounding, *(_cell(by_input.get(parameter.name)) for by_input in elasticities.values()))


def _cell(entry: dict | None) -> str:
    if entry is None:
        return "-"
    word = f"{entry['elasticity']:+.3f}" if entry["resolved"] else f"{entry['elasticity']:+.1g}, not resolved"
    large = entry.get("by_10_percent")
    by_10_percent = f"; ± 10 %: {large[0]:+.2g}, {large[1]:+.2g} %" if large else ""
    return f"{word} (± {entry['bar']:.1g}){by_10_percent}"


def _set(one_set: dict) -> Iterator[str]:
    sentence = (f"{'A' if one_set['reached'] else 'No'} set of inputs within the rounding gives all printed numbers of "
                f"base at once. A closed form proves it: {sensitivity.impossible()}.")
    sizes = _listed(one_set["sizes"], ".3g")
    yield "## One set of inputs"
    yield (f"{sentence} By the elasticities, which are extrapolated beyond the rounding, a set would take "
           f"{one_set['share_of_the_rounding']:.2f} times the rounding. The nearest set within it was run on sizes "
           f"{sizes} of elements and steps, over those of `accurate`. The bar follows from all of them, and a set "
           "counts if the whole bar lies in the interval of the printed digits.")
    yield table(("number", "printed", "a run with the set", "bar", "on these sizes"), (
        (_title_of(name), "{:g} to {:g}".format(*interval(rounding.PRINTED[name])), f"{value:.4f}",
         f"{one_set['bars'][name]:.1g}", _listed(one_set["on_sizes"][name], ".4f"))
        for name, value in one_set["numbers"].items()))
    yield table(("input", "value"), ((name, f"{value:.4f}") for name, value in one_set["inputs"].items()))


def _listed(values: list[float], form: str) -> str:
    return ", ".join(format(value, form) for value in values)


def _supplies(by_supply: dict) -> Iterator[str]:
    yield "## The supply of Figure 6, which is not printed"
    yield table(("supply of both (K_s)", "contact (h)", "ends at contact (um)", "least acceptor then (K_s)"), (
        (supply, f"{result['contact_time']:.1f}", f"{result['upstream']:.0f} to {result['downstream']:.0f}",
         f"{result['acceptor_min']:.2g}") for supply, result in by_supply.items()))
    yield f"![Outlines with each supply]({OUTLINES.name})"
    yield from _verdicts(by_supply)


def _verdicts(by_supply: dict[str, dict]) -> Iterator[str]:
    """Which claims about wide hold with which supplies."""
    every, some, none = (", ".join(ids) or "none" for ids in wide.verdicts(by_supply))
    yield ("Of the claims about this run, each judged again with the converged solution at one size, to "
           f"{wide.AFTER} h after contact or until the aggregate reaches an end of the pore, these hold with all "
           f"supplies: {every}; with some: {some}; with none: {none}.")
    yield "Numbers that hold with some supplies and not with all:"
    yield table(("claim", *(f"{supply} K_s" for supply in by_supply)), (
        (name, *map({True: "yes", False: "no"}.get, holds)) for name, holds in wide.moving(by_supply)))


def _after_contact(rows: list[dict]) -> Iterator[str]:
    yield "## Accuracy of wide after contact"
    yield ("Values from the finest size to the coarsest; means are over whole hours from contact to 45 h. A single row "
           "jumps if one more edge of the outline joins the wall.")
    yield table(("number", "values", "bar (%)", "accepted (%)", "met"), (
        (row["quantity"], _listed(row["values"], ".4g"), f"{row['bar_percent']:.2g}",
         f"{row['asked_percent']:g}", "yes" if row["kept"] else "no") for row in rows))


def _sobol(indices: dict) -> Iterator[str]:
    widest = max(0.5 * (high - low) for entry in indices["numbers"].values() for _, low, high in entry["total_order"])
    yield "## Sobol indices of base"
    yield (f"Total indices of {indices['samples']} samples in `fast`, with intervals of "
           f"{100 * indices['confidence']:.0f} %: the share of an input in the variance of a number within the "
           f"rounding. The widest of the intervals is {widest:.2f} to either side.")
    yield table(("number", *indices["inputs"]), (
        (_title_of(name), *map(_index, entry["total_order"])) for name, entry in indices["numbers"].items()))


def _index(bounds: list[float]) -> str:
    return "{:.2f} ({:.2f} to {:.2f})".format(*bounds)


#: Page sections of the parts of the record, in order.
SECTIONS: dict[str, Callable[..., Iterator[str]]] = {
    "one_set": _set, "after_contact": _after_contact, "supplies": _supplies, "sobol": _sobol}


def main(arguments: list[str] | None = None) -> int:
    """Entry point; returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m verification.sensitivity", description=__doc__.split("\n")[0])
    parser.add_argument("--only", choices=tuple(PARTS), help="compute one part alone; the others stay as recorded")
    record = computed(Runs(), parser.parse_args(arguments).only)
    write_json(sensitivity.RECORD, record)
    write(record)
    write_text(sensitivity.RECORD.with_suffix(".md"), page(record))
    print(f"{sensitivity.RECORD.name}, its page, tornado.svg and supplies.svg: written")
    return 0


def computed(runs: Runs, only: str | None) -> dict:
    """The record with the requested parts computed; the others do not change."""
    record = {"values": {}, "elasticities": {}, **sensitivity.record()}
    record["rounding"] = {parameter.name: parameter.rounding for parameter in ROUNDED}
    for name in PARTS if only is None else (only,):
        PARTS[name](runs, record)
    return record


def _of_scene(runs: Runs, record: dict, name: str = "wide") -> None:
    record["values"] |= runs.get(load_varied(name, {}))
    record["elasticities"] |= rounding.elasticities(runs, name)


def _of_base(runs: Runs, record: dict) -> None:
    _of_scene(runs, record, "base")
    record["one_set"] = rounding.one_set(runs, record["elasticities"])


#: What adds each part to the record.
PARTS: dict[str, Callable[[Runs, dict], None]] = {
    "base": _of_base,
    "wide": _of_scene,
    "after_contact": lambda runs, record: record.update(after_contact=wide.after_contact(runs)),
    "supplies": lambda runs, record: record.update(supplies=wide.contacts(runs)),
    "sobol": lambda runs, record: record.update(sobol=rounding.sobol(runs, record["elasticities"]))}


if __name__ == "__main__":
    sys.exit(main())
