"""Compare the model with measurements: ``python -m verification.validation [SECTION ...]`` (`make validation`).

A function of each section of ``docs/validation.md`` computes its rows. The page states beforehand what is compared, and
the criterion. The rows go to ``verification/report/validation.json``, and from there between the marks of the page. A
test compares the two.
"""

import math
import sys
from collections.abc import Callable, Iterator
from functools import cache

import numpy as np

import repro
from reference import layered_channel, semicircle_channel
from repro import load_scene
from repro.march.simulation import simulate
from repro.results import write_text
from repro.scene.keys import PRESETS
from verification.cases import flow_semicircles
from verification.evidence.writing import REPORT, ROOT, load, save, table
from verification.problems.arrangements import ARRANGEMENTS, COMPARED, seeds
from verification.problems.hard import clean_conductivity

PAGE, RECORD = ROOT / "docs" / "validation.md", REPORT / "validation.json"
HEAD = ("quantity", "source", "model", "verdict")
VERDICTS = {True: "agrees", False: "disagrees", None: ""}
#: What a change that no source measured does to the conductivity; the summary counts it among the rows without verdict.
EFFECTS = {True: "does not matter", False: "matters"}
Row = tuple[str, str, str, str]
SECTIONS: dict[str, Callable[[], Iterator[Row]]] = {}

FAST = 'numerics.preset="fast"'
#: A darcy, um2.
DARCY = 0.9869233
LAMBDA = 2000.0


def section(compute: Callable[[], Iterator[Row]]) -> Callable[[], Iterator[Row]]:
    """Register the rows of a section under the name of the function."""
    SECTIONS[compute.__name__] = compute
    return compute


def row(quantity: str, source: str, model: str, agrees: bool | None = None) -> Row:
    """A row; its verdict is empty if the section has no criterion for it."""
    return quantity, source, model, VERDICTS[agrees]


@cache
def solved(scene: str, end: float, *changes: str, every: float = 1.0) -> repro.Results:
    """A run of a packaged scene to an end (h), with rows at each ``every`` hours."""
    return repro.solve(scene, [FAST, f'growth.end="{end:g} h"', f'output.every="{every:g} h"', *changes])


@cache
def last_conductivity(scene: str, end: float, *changes: str) -> float:
    """Conductivity (um/h) of a packaged scene at an end (h), without the other columns of a row: those of the wall need
    an equilibrium of their own, which a soft aggregate may not have."""
    *_, last = simulate(scene, [FAST, f'growth.end="{end:g} h"', f'output.times=["{end:g} h"]', *changes])
    return last.solved.flow.conductivity


def at(results: repro.Results, hour: float, name: str = "conductivity_m_per_d") -> float:
    """A column at a time; NaN after the end of the run."""
    return float(np.interp(hour, results["time_h"], results[name], right=np.nan))


def course(name: str) -> tuple[np.ndarray, np.ndarray]:
    """Fraction of Base's pore that an arrangement fills, and K / K_0, under Base's head."""
    return of_pore("base", solved("base", 60, seeds(ARRANGEMENTS[name])))


def of_pore(scene: str, results: repro.Results) -> tuple[np.ndarray, np.ndarray]:
    """Fraction of the pore of a packaged scene, and K / K_0, of the rows of a run."""
    pore = load_scene(scene, ())
    return (results["aggregate_area_um2"] / (pore.pore.width * pore.pore.length),
            results["conductivity_m_per_d"] / clean_conductivity(pore))


def layer_left(fraction: float) -> float:
    """K / K_0 of a pore with a uniform layer on one wall, in closed form."""
    return 12 / layered_channel.gradient(1.0, fraction, LAMBDA)


@section
def dupin() -> Iterator[Row]:
    """Times of an expansion by 2000."""
    for speed in (0.9, 3.6):
        results = solved("wide", 72, f'flow.mean_velocity="{speed:g} m/day"', every=3)
        hours = [hour for hour in results["time_h"] if hour % 3 == 0]
        theta = np.maximum.accumulate([np.nanmax(results.fields(hour)["theta"]) for hour in hours])
        growth = results["aggregate_area_um2"] / results["aggregate_area_um2"][0]
        time, words = _expanded(np.array(hours), theta)
        yield row(f"hours until a point has expanded 2000 times, {speed:g} m/d", "a couple of days", words)
        time, words = _expanded(results["time_h"], growth)
        yield row(f"hours until the area is 2000 times the seed's, {speed:g} m/d", "a couple of days", words,
                  24 <= time <= 72)


def _expanded(hours: np.ndarray, factors: np.ndarray) -> tuple[float, str]:
    """The time (h) of a factor of 2000, NaN if it is not reached, and the words for it."""
    if factors[-1] < 2000:
        return math.nan, f"not until {hours[-1]:.0f} h, {factors[-1]:.0f} times"
    time = float(np.interp(math.log(2000), np.log(factors), hours))
    return time, f"{time:.0f}"


@section
def figure_1() -> Iterator[Row]:
    """Growth of two aggregates in two days."""
    results = solved("wide", 96, seeds(((-100, "lower"), (100, "lower")), 5 * math.sqrt(2)))
    fraction, _ = of_pore("wide", results)
    start = float(np.interp(np.log(0.05), np.log(fraction), results["time_h"]))
    end = min(start + 48, results["time_h"][-1])
    for number, place in enumerate(("upstream", "downstream"), 1):
        first, last = (at(results, hour, f"aggregate_{number}_area_um2") for hour in (start, end))
        yield row(f"growth of the {place} aggregate's area in {end - start:.0f} h", "not printed",
                  f"{last / first:.2f} times")
    yield row("beginning and end of these hours", "not printed", f"{start:.1f} h, {end:.1f} h ({results.status})")


@section
def jiao() -> Iterator[Row]:
    """Ratios of conductivities between places, and the permeability of biomass."""
    left = {}
    for name in ARRANGEMENTS:
        fraction, conductivity = course(name)
        left[name] = float(np.exp(np.interp(COMPARED * 50 / 600, fraction, np.log(conductivity), right=np.nan)))
    best, worst = max(left, key=left.__getitem__), min(left, key=left.__getitem__)
    ratio = left[best] / left[worst]
    yield row("conductivities of equal biomass, best over worst place", f"{0.22 / 0.06:.1f}",
              f"{ratio:.1f} ({best} over {worst})", ratio >= 0.22 / 0.06)
    for width in (50, 100):
        darcys = width**2 / (12 * LAMBDA) / DARCY
        yield row(f"permeability of biomass (darcy), W = {width} um", "0.3 to 2.5", f"{darcys:.2g}",
                  0.3 / 3 <= darcys <= 2.5 * 3)
    base = at(solved("wide", 45), 40)
    for darcys in (0.5, 2.5):
        permeable = solved("wide", 45, f'flow.permeability="{darcys * DARCY:.4g} um^2"')
        yield row(f"conductivity of Figure 6's pore at 40 h with {darcys:g} darcy, over that with lambda = 2000", "-",
                  f"{at(permeable, 40) / base:.2f}")


@section
def kurz() -> Iterator[Row]:
    """Closing without nutrients, and the force of the water as a gap narrows."""
    cut = [f'substrates.{name}.supply=[["0 h", "10 mg/L"], ["24 h", "0 mg/L"]]' for name in ("acceptor", "donor")]
    starved = solved("base", 28, *cut)

    def rate(first: float, last: float) -> float:
        return math.log(at(starved, first) / at(starved, last)) / (last - first)

    ratio = rate(26, 28) / rate(22, 23.999)
    yield row("rate of closing without nutrients over that before", "stops", f"{ratio:.3f}")
    results = solved("wide", 34, 'growth.fluid_forces="included"', every=0.5)
    gap = 1 - results["thickness_um"] / 100
    force = results["fluid_force_x_uN_per_m"]
    narrowing = gap <= 0.5
    increases = (np.diff(force[narrowing]) > 0).all()
    factor = float(np.interp(-0.1, -gap, force) / np.interp(-0.5, -gap, force))
    yield row("force of the water at a gap of 0.1 W over that at 0.5 W", "increases as the path narrows",
              f"{factor:.1f}, {'' if increases else 'not '}monotonic", bool(increases and factor > 5))


@section
def vandevivere() -> Iterator[Row]:
    """Slopes of ln K against biomass."""
    fractions = np.linspace(0, 1, 100001)[:-1]
    layers = np.array([layer_left(value) for value in fractions[::100]])
    for name, (fraction, left) in {"one aggregate": course("one"), "eight alternating": course("eight alternating"),
                                   "layer": (fractions[::100], layers)}.items():
        yield _exponential(name, fraction, left)


def _exponential(name: str, fraction: np.ndarray, left: np.ndarray) -> Row:
    """Judge whether one exponential describes losses of 5 to 50 %, and another one those of 50 to 90 %."""
    log = -np.log(left)
    marks = -np.log([0.95, 0.9, 0.8, 0.7, 0.6, 0.5])
    slopes = np.diff(marks) / np.diff(np.interp(marks, log, fraction))
    spread = slopes.max() / slopes.min()
    ends = np.interp(-np.log([0.95, 0.5, 0.1]), log, fraction, right=np.nan)
    below, above = np.diff(-np.log([0.95, 0.5, 0.1])) / np.diff(ends)
    return row(f"largest over least slope, and slope beyond 50 % over that before: {name}",
               "one exponential below a mass, another one above", f"{spread:.2f}, {above / below:.2f}",
               bool(spread <= 1.5 and not 1 / 1.5 <= above / below <= 1.5))


@section
def taylor() -> Iterator[Row]:
    """K / K_0 at the biomass above which the permeability of the columns falls no more."""
    carbon = 60 / 113
    of_column = 0.4 / carbon / 30
    fraction = of_column / (1 - math.pi / math.sqrt(18))
    yield row("biomass at 0.4 mg/cm3 of carbon (% of the column, of the pores at most)", "-",
              f"{100 * of_column:.1f}, {100 * fraction:.1f}")
    curves = {"one aggregate, W = 50 um": course("one"), "two facing, W = 50 um": course("two facing"),
              "one aggregate, W = 100 um": of_pore("wide", solved("wide", 45))}
    left = {name: float(np.exp(np.interp(fraction, share, np.log(k), right=np.nan)))
            for name, (share, k) in curves.items()}
    for name, value in {**left, "layer": layer_left(fraction)}.items():
        if math.isfinite(value):
            yield row(f"K / K_0 at {100 * fraction:.1f} % of the pore: {name}", "order of 10^-3", f"{value:.2g}",
                      value <= 1e-2)
        else:
            share, k = curves[name]
            yield row(f"K / K_0 at the end of its run: {name}", "order of 10^-3",
                      f"{k[-1]:.2g} at {100 * share[-1]:.1f} %")


@section
def cunningham() -> Iterator[Row]:
    """Losses of pores that are half, and nearly, filled."""
    share, left = of_pore("base", solved("base", 72))
    losses = {"layer, 50 %": 1 - layer_left(0.5), "layer, 96 %": 1 - layer_left(0.96),
              "one aggregate, 50 %": 1 - float(np.interp(0.5, share, left, right=np.nan))}
    for name, loss in losses.items():
        known = math.isfinite(loss)
        yield row(f"loss of permeability (%): {name} of the pore", "92 to 98",
                  f"{100 * loss:.2f}" if known else
                  f"not reached; {100 * (1 - left[-1]):.2f} at {100 * share[-1]:.0f} %",
                  0.87 <= loss <= 1.03 if name == "layer, 50 %" else None)
    for loss in (0.92, 0.98):
        filled = float(np.interp(-math.log(1 - loss), -np.log(left), share))
        yield row(f"biomass at a loss of {100 * loss:.0f} % (% of the pore), one aggregate", "50 to 96",
                  f"{100 * filled:.1f}")
    yield row("permeability left at 96 % (%), layer", "2 to 8", f"{100 * layer_left(0.96):.2g}")
    yield row("permeability of biomass over that of the clean pore, if it fills a pore and leaves 2 %", "0.02",
              f"{1 / LAMBDA:g}")


@section
def stiffness() -> Iterator[Row]:
    """The elastic modulus, its effect with the fluid's forces, and that of a memory that fades."""
    yield row("elastic modulus (Pa)", "17 to 6000", "30000", 17 <= 30000 <= 6000)
    forces, fading = 'growth.fluid_forces="included"', 'growth.new_biomass="stress_free"'
    for modulus in (6000, 1270, 17):
        softer = f'growth.shear_modulus="{modulus / 3 * 1e-6:.6g} MPa"'
        for hour in (33, 40):
            yield _change(f"{modulus} Pa with the fluid's forces, Figure 6", "wide", hour, (forces, softer), (forces,))
    for name, scene, hour in (("Base", "base", 19.4), ("Figure 6", "wide", 33), ("Figure 6", "wide", 40)):
        yield _change(f"no memory, {name}", scene, hour, (fading,), ())


def _change(name: str, scene: str, hour: float, changed: tuple[str, ...], unchanged: tuple[str, ...]) -> Row:
    """The change of the conductivity at a time, and whether it matters: 5 % or more; or why the changed run stops."""
    quantity = f"change of conductivity at {hour:g} h (%), {name}"
    try:
        change = last_conductivity(scene, hour, *changed) / last_conductivity(scene, hour, *unchanged) - 1
    except repro.SimulationError as error:
        return row(quantity, "-", str(error).partition(", in growth")[0] + ": Newton finds no equilibrium")
    return quantity, "-", f"{100 * change:.2f}", EFFECTS[abs(change) < 0.05]


@section
def semicircles() -> Iterator[Row]:
    """Losses of semicircles."""
    for walls, radii in flow_semicircles.RADII.items():
        for radius in radii:
            exact, _ = semicircle_channel.excess_loss(radius, walls == "facing")
            accurate, fine = (flow_semicircles.excess(radius, walls == "facing", refinement) / exact - 1
                              for refinement in (PRESETS["accurate"]["refinement"], flow_semicircles.REFINEMENT))
            yield row(f"loss in widths of a clean channel, {walls}, R = {radius:g} W", f"{exact:.5g}",
                      f"{accurate:+.1e} (finer elements: {fine:+.0e})", abs(accurate) <= 1e-3)


@section
def lubrication() -> Iterator[Row]:
    """Losses of narrow gaps."""
    for gap in (0.16, 0.08, 0.04, 0.02):
        loss = flow_semicircles.excess(1 - gap)
        limit, next_term = (semicircle_channel.film(1 - gap, gap, terms) for terms in (1, 2))
        yield row(f"loss over its limit, less one, gap of {gap:g} W", f"{next_term / limit - 1:.5f}",
                  f"{loss / limit - 1:.5f}", abs(loss / next_term - 1) <= 1e-3 if gap == 0.02 else None)


def begin(name: str) -> str:
    """The mark before the table of a section."""
    return f"<!-- validation: begin {name} -->\n"


END = "<!-- validation: end -->"


def counts(page: str, record: dict[str, list]) -> Iterator[tuple[str, int, int, int]]:
    """The heading of each section on the page, and its rows that agree, that disagree, and that have no verdict."""
    for name, rows in record.items():
        heading = page.partition(begin(name))[0].rpartition("\n## ")[2].partition("\n")[0]
        agree, disagree = (sum(cells[3] == VERDICTS[agrees] for cells in rows) for agrees in (True, False))
        yield heading, agree, disagree, len(rows) - agree - disagree


def summary(page: str, record: dict[str, list]) -> str:
    """The table of the counts."""
    return table(("section", "agrees", "disagrees", "without a verdict"), counts(page, record))


def within(page: str, record: dict[str, list]) -> str:
    """Return the page with the summary, and with the table of each section, between their marks."""
    tables = {"summary": summary(page, record), **{name: table(HEAD, rows) for name, rows in record.items()}}
    for name, text in tables.items():
        before, mark, rest = page.partition(begin(name))
        _, _, after = rest.partition(END)
        page = f"{before}{mark}\n{text}\n\n{END}{after}"
    return page


def main(names: list[str]) -> None:
    """Compute some sections, or all, and write record and page."""
    record = load(RECORD, {})
    for name in names or SECTIONS:
        record[name] = [list(values) for values in SECTIONS[name]()]
        record = {each: record[each] for each in SECTIONS if each in record}
        print(name, *(" | ".join(values) for values in record[name]), sep="\n  ", flush=True)
        save(record, RECORD)
    write_text(PAGE, within(PAGE.read_text(encoding="utf-8"), record))


if __name__ == "__main__":
    main(sys.argv[1:])
