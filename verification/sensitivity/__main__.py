"""`python -m verification.sensitivity [--only PART]`: what the inputs allow, with pictures and a page.

Its parts are base and wide, their elasticities and the one set of inputs; after_contact, how well wide is known after
contact; supplies, which of the claims about wide hold with other supplies; and sobol, indices of base.

Every run is kept in `out/runs.jsonl` as it is computed, and a second call goes on from there."""

from __future__ import annotations

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
from verification.evidence.writing import Block, markdown, table
from verification.sensitivity import rounding, wide
from verification.sensitivity.rounding import INPUTS, ROUNDED, Input, Runs, scene

TARGET, OUTLINES = (Path(__file__).parent / name for name in ("tornado.svg", "supplies.svg"))
NAMES = {"velocity_0": "mean velocity, t = 0", "velocity": "mean velocity, 19.2 h",
         "effluent_acceptor": "effluent acceptor, 19.4 h", "effluent_donor": "effluent donor, 19.4 h",
         "contact_time": "time of contact (wide)", "conductivity_after": "conductivity 4 h after contact (wide)"}
UP, DOWN = "#D55E00", "#0072B2"
UNMOVED = "no rounding of an input moves it"
#: Width of wide (um).
WIDTH = 100.0


def reaches(record: dict, number: str) -> list[tuple[str, float, bool]]:
    """Rounded inputs and what half a unit of their last digit makes of a number (%), the largest first; is it resolved?
    """
    known = record["elasticities"][number]
    found = [(each.name, 100 * known[each.name]["elasticity"] * each.rounding, known[each.name]["resolved"])
             for each in ROUNDED]
    return sorted(found, key=lambda row: -abs(row[1]))


def write(record: dict, target: Path = TARGET, outlines: Path = OUTLINES) -> None:
    """Both pictures."""
    tornado(record, target)
    of_supplies(record["supplies"], outlines)


def _saved(made: Figure, target: Path) -> None:
    """The same bytes for the same record."""
    with matplotlib.rc_context({"svg.hashsalt": "sensitivity", "svg.fonttype": "none"}):
        made.savefig(target, format="svg", metadata={"Date": None, "Creator": None})


def of_supplies(found: dict[str, dict], target: Path) -> None:
    """Outlines of wide every 5 h, a supply a row, the latest at the back."""
    made = Figure(figsize=(9, 1.7 * len(found)), layout="constrained")
    for axes, (supply, known) in zip(made.subplots(len(found), sharex=True), found.items()):
        *_, last = map(float, known["outlines"])
        for time, places in reversed(known["outlines"].items()):
            colour = matplotlib.colormaps["viridis_r"](float(time) / last)
            axes.fill(*_places(places).T, facecolor=colour, edgecolor="white")
        axes.set_ylim(0, WIDTH)
        axes.set_aspect("equal")
        axes.set_title(f"{supply} K_s: every 5 h to {last:g} h; contact at {known['contact_time']:.1f} h", loc="left",
                       fontsize=10)
    axes.set_xlabel("x (um); the fluid comes from the left")
    _saved(made, target)


def _places(text: str) -> np.ndarray:
    """(M, 2) um."""
    return np.array([pair.split(",") for pair in text.split()], float)


def tornado(record: dict, target: Path) -> None:
    """The diagram: of each number the inputs in their order, an input's printed digit up and down; hatched what is not
    resolved."""
    lines = len(NAMES) // 2
    made = Figure(figsize=(9, 2.6 * lines), layout="constrained")
    for axes, number in zip(made.subplots(lines, 2).ravel(), NAMES):
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
    made.suptitle("Half a unit of the last printed digit of an input: upwards (orange), downwards (blue); hatched: not "
                  "resolved", fontsize=10)
    _saved(made, target)


def _bars(axes: Axes, name: str, value: float, resolved: bool) -> None:
    """Both bars of an input."""
    for change, colour in ((value, UP), (-value, DOWN)):
        look = {"color": colour} if resolved else {"facecolor": "none", "edgecolor": colour, "hatch": "////"}
        axes.barh(name, change, height=0.7, **look)


def page(record: dict) -> str:
    """The record in words and tables."""
    words = ("Elasticities d ln(number) / d ln(input), by central differences of the converged solution; ± is their "
             "bar, and one that exceeds a tenth of the value is *not resolved*. `make sensitivity` writes this page.")
    blocks = [Block("text", words), Block("text", f"![Tornado diagram]({TARGET.name})"), _table(record)]
    for part, section in SECTIONS.items():
        blocks += section(record[part])
    return f"# What the inputs of Table 1 allow\n\n{markdown(blocks, 2)}\n\n"


def _table(record: dict) -> Block:
    known = record["elasticities"]
    return table(("input", "rounding (%)", *map(_called, known)), (_row(each, known) for each in INPUTS))


def _called(number: str) -> str:
    return NAMES.get(number, number.replace("_", " "))


def _row(each: Input, elasticities: dict[str, dict]) -> tuple[str, ...]:
    rounding = f"{100 * each.rounding:.2g}" if each.half else "exact"
    return (each.name, rounding, *(_cell(known.get(each.name)) for known in elasticities.values()))


def _cell(known: dict | None) -> str:
    if known is None:
        return "-"
    word = f"{known['elasticity']:+.3f}" if known["resolved"] else f"{known['elasticity']:+.1g}, not resolved"
    large = known.get("by_10_percent")
    told = f"; ± 10 %: {large[0]:+.2g}, {large[1]:+.2g} %" if large else ""
    return f"{word} (± {known['bar']:.1g}){told}"


def _set(found: dict) -> Iterator[Block]:
    words = ("One set of inputs within the rounding gives all printed numbers of base at once" if found["reached"] else
             "No set of inputs within the rounding gives all printed numbers of base at once; the nearest")
    sizes = _listed(found["sizes"], ".3g")
    yield Block("heading", "One set of inputs")
    yield Block("text", f"{words} (a share of {found['share_of_the_rounding']:.2f} of the rounding is needed). It was "
                        f"run on sizes {sizes} of elements and steps, over those of `accurate`; the bar is from all of "
                        "them, and a set counts where the whole bar lies in the interval of the printed digits.")
    yield table(("number", "printed", "a run with the set", "bar", "on these sizes"), (
        (_called(name), "{:g} to {:g}".format(*interval(rounding.PRINTED[name])), f"{value:.4f}",
         f"{found['bars'][name]:.1g}", _listed(found["on_sizes"][name], ".4f"))
        for name, value in found["numbers"].items()))
    yield table(("input", "value"), ((name, f"{value:.4f}") for name, value in found["inputs"].items()))


def _listed(values: list[float], how: str) -> str:
    return ", ".join(format(value, how) for value in values)


def _supplies(found: dict) -> Iterator[Block]:
    yield Block("heading", "The supply of Figure 6, which is not printed")
    yield table(("supply of both (K_s)", "contact (h)", "ends at contact (um)", "least acceptor then (K_s)"), (
        (supply, f"{known['contact_time']:.1f}", f"{known['upstream']:.0f} to {known['downstream']:.0f}",
         f"{known['acceptor_min']:.2g}") for supply, known in found.items()))
    yield Block("text", f"![Outlines with each supply]({OUTLINES.name})")
    yield from _held(found)


def _held(found: dict[str, dict]) -> Iterator[Block]:
    """Which claims about wide hold with which supplies."""
    every, some, none = (", ".join(ids) or "none" for ids in wide.verdicts(found))
    yield Block("text", "Of the claims about this run, each judged anew with the converged solution at one size, to "
                f"{wide.AFTER} h after contact or until the aggregate reaches an end of the pore, these hold with "
                f"all supplies: {every}; with some: {some}; with none: {none}.")
    yield Block("text", "Numbers that hold with some supplies and not with all:")
    yield table(("claim", *(f"{supply} K_s" for supply in found)), (
        (name, *map({True: "yes", False: "no"}.get, held)) for name, held in wide.moving(found)))


def _after_contact(found: list[dict]) -> Iterator[Block]:
    yield Block("heading", "How well wide is known after contact")
    yield Block("text", "Values from the finest size to the coarsest; means are over whole hours from contact to 45 h. "
                "A single row jumps as one more edge of the outline comes to rest on the wall.")
    yield table(("number", "values", "bar (%)", "asked (%)", "kept"), (
        (known["quantity"], _listed(known["values"], ".4g"), f"{known['bar_percent']:.2g}",
         f"{known['asked_percent']:g}", "yes" if known["kept"] else "no") for known in found))


def _sobol(found: dict) -> Iterator[Block]:
    widest = max(0.5 * (high - low) for known in found["numbers"].values() for _, low, high in known["total_order"])
    yield Block("heading", "Sobol indices of base")
    yield Block("text", f"Total indices of {found['samples']} samples in `fast`, with intervals of "
                f"{100 * found['confidence']:.0f} %: the share of a number's variance within the rounding that goes "
                f"with an input. The widest of the intervals is {widest:.2f} to either side.")
    yield table(("number", *found["inputs"]), (
        (_called(name), *map(_index, known["total_order"])) for name, known in found["numbers"].items()))


def _index(known: list[float]) -> str:
    return "{:.2f} ({:.2f} to {:.2f})".format(*known)


#: What is told of the parts of the record, in this order.
SECTIONS: dict[str, Callable[..., Iterator[Block]]] = {
    "one_set": _set, "after_contact": _after_contact, "supplies": _supplies, "sobol": _sobol}


def main(arguments: list[str] | None = None) -> int:
    """Entry point; returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m verification.sensitivity", description=__doc__.split("\n")[0])
    parser.add_argument("--only", choices=tuple(PARTS), help="one part alone; the record of the others stays")
    made = computed(Runs(), parser.parse_args(arguments).only)
    write_json(sensitivity.RECORD, made)
    write(made)
    write_text(sensitivity.RECORD.with_suffix(".md"), page(made))
    print(f"{sensitivity.RECORD.name}, its page, tornado.svg and supplies.svg: written")
    return 0


def computed(runs: Runs, only: str | None) -> dict:
    """The record, what is not asked for as it is."""
    made = {"values": {}, "elasticities": {}, **sensitivity.record()}
    made["rounding"] = {each.name: each.rounding for each in ROUNDED}
    for name in PARTS if only is None else (only,):
        PARTS[name](runs, made)
    return made


def _of_scene(runs: Runs, made: dict, name: str = "wide") -> None:
    made["values"] |= runs.get(scene(name, {}))
    made["elasticities"] |= rounding.elasticities(runs, name)


def _of_base(runs: Runs, made: dict) -> None:
    _of_scene(runs, made, "base")
    made["one_set"] = rounding.one_set(runs, made["elasticities"])


#: What adds each part to the record.
PARTS: dict[str, Callable[[Runs, dict], None]] = {
    "base": _of_base,
    "wide": _of_scene,
    "after_contact": lambda runs, made: made.update(after_contact=wide.after_contact(runs)),
    "supplies": lambda runs, made: made.update(supplies=wide.contacts(runs)),
    "sobol": lambda runs, made: made.update(sobol=rounding.sobol(runs, made["elasticities"]))}


if __name__ == "__main__":
    sys.exit(main())
