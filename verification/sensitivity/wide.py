"""Wide, whose supply the paper does not print: its accuracy after contact with the opposite wall, and its response to
supplies of 5 to 40 K_s of both substrates.

**After contact**: conductivity, tips, and length of contact, in the mean, 5 h after contact and at 45 h. A contact
surface grows by entire edges of the outline, so a single row jumps by an edge or two if the time changes at which a
node joins. The mean over the hours from contact to the end of Figure 6 does not jump. The bar is that of
`verification.uncertainty` from the converged solution on four sizes of elements and steps. The sizes were first 0.5 to
sqrt(2); twice a finer size replaced the coarsest: sqrt(2), whose conductivity at 45 h is 0.4 % off while the next four
differ by 0.15 %, and 1, which is 0.5 % off at 39 h while the others differ by 0.11 %.

**Supplies**: for each, the time of contact, outlines every 5 h, and the claims about wide that hold. The run ends as
long after contact as Figure 6, or when the aggregate reaches an end of the pore. The claims are the functions of
`verification.claims`, with the converged solution at one size, so that numbers have no bars; a claim holds if all of
its checks about wide hold."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from math import floor

import numpy as np
import shapely

from repro.errors import RunEnd
from repro.march import simulation
from repro.march.state import RestartState
from verification.claims import CLAIMS, Finding, evaluate
from verification.claims.evaluate import MESH_ORDERS, unnumbered
from verification.claims.levels import CONVERGED, Level, at_level, converged, forget
from verification.claims.runs import WIDE, bodies, ending, polygon, series
from verification.problems import runs as problems
from verification.sensitivity.rounding import OF, Row, Runs, column, load_varied, touching
from verification.uncertainty import estimate

SIZES = (0.25, 2**-1.5, 0.5, 2**-0.5)
#: Whole hours (h) after contact, which comes at 34.3 h.
HOURS = tuple(map(float, range(35, 46)))
#: The whole hour that is 5 h after contact.
LATER = 39.0
#: Prefixes of the names: means over HOURS, values at LATER, and values at the last of HOURS.
KINDS = ("mean of", f"{LATER:g} h:", "last")
#: Largest accepted bars, in percent of the number.
REQUIRED_BARS = {"conductivity (m/d)": 1.0, "upstream tip (um)": 1.0, "downstream tip (um)": 1.0,
                 "length of contact (um)": 2.0}


def of_after(scene) -> Row:
    """Means over HOURS (geometric, of magnitudes), values at LATER and at the last of HOURS. Raises LookupError if one
    of HOURS is before contact."""
    after = [instant for _, instant in simulation.steps(scene) if instant and instant.pore.contact]
    if len(after) != len(HOURS):
        raise LookupError(f"{len(after)} of {len(HOURS)} rows are after contact")
    table = np.array([[*problems.after_contact(report).values()] for report in after])
    means = np.exp(np.log(np.abs(table)).mean(axis=0))
    rows = zip(KINDS, (means, table[HOURS.index(LATER)], table[-1]))
    return {f"{kind} {name}": float(abs(value)) for kind, row in rows for name, value in zip(REQUIRED_BARS, row)}


OF["after contact"] = of_after


def after_contact(runs: Runs) -> list[dict]:
    """Each number on all sizes, its bar (%), and whether the bar is small enough."""
    plain = (ending(load_varied("wide", {}, *converged(size)), *HOURS) for size in SIZES)
    rows = runs.get_all(replace(scene, name="after contact") for scene in plain)
    return [_bar_of(rows, f"{kind} {name}", required)
            for kind, (name, required) in product(KINDS, REQUIRED_BARS.items())]


def _bar_of(rows: list[Row], quantity: str, required: float) -> dict:
    """The entry of a number from the runs on SIZES."""
    values = column(rows, quantity)
    bar = 100 * estimate(SIZES, values, MESH_ORDERS).bar / abs(values[0])
    return {"quantity": quantity, "values": values, "bar_percent": bar, "asked_percent": required,
            "kept": bar <= required}


#: Supplies over K_s, and the size of the converged solution's elements and steps.
SUPPLIES, SIZE = (5.0, 10.0, 20.0, 40.0), 2**0.5
#: Hours within which the aggregate touches the wall with every supply.
END = 120.0
#: Claims about this run that are not judged again, with the reasons: they compare it with other models.
LEFT_OUT = {"C32": "compares two rheologies of new biomass", "C41": "changes the rheology and the walls",
            "C46": "compares its stresses with and without the fluid's forces",
            "C63": "compares its shapes with and without them"}
#: Hours before it reaches an end of the pore at which an aggregate is still clear of it.
MARGIN = 0.1
#: Whole hours that wide continues after contact: to 45 h for Figure 6's own 10 K_s.
AFTER = 11
#: Hours between outlines, and the accuracy (um) of their points.
EVERY, FINE = 5, 0.1


def of_contact(scene) -> dict[str, float]:
    """Time of contact (h), the ends of the aggregate (um) and the smallest acceptor (K_s) then, and the last full hour,
    at most AFTER contact, before the aggregate reaches an end of the pore."""
    scene = ending(scene, END)
    state = touching(scene)
    last = float(floor(state.pore.time) + AFTER)
    outline, acceptor = state.pore.boundary, state.pore.concentrations.acceptor
    return {"contact_time": state.pore.time, "upstream": outline.upstream, "downstream": outline.downstream,
            "acceptor_min": float(acceptor.min()) / scene.substrates.acceptor.half_saturation,
            "end": float(floor(reached(ending(scene, last), state)))}


def reached(scene, state: RestartState) -> float:
    """Last time (h) of a run from a state: its end, or MARGIN before the aggregate reaches an end of the pore."""
    time = state.pore.time
    try:
        for state_reached, _ in simulation.steps(scene, state):
            time = state_reached.pore.time
    except RunEnd:
        return time - MARGIN
    return scene.growth.end


OF["contact"] = of_contact


def contacts(runs: Runs) -> dict[str, dict]:
    """{supply over K_s: numbers of `of_contact`, outlines, and the checks of the claims about wide}."""
    evaluate.register_all()
    return {f"{supply:g}": _of_supply(runs, supply) for supply in SUPPLIES}


def _of_supply(runs: Runs, supply: float) -> dict:
    print(f"wide: a supply of {supply:g} K_s", flush=True)
    factors = {"supply of acceptor": supply / 10, "supply of donor": supply / 10}
    contact = runs.get(replace(load_varied("wide", factors, *converged(SIZE)), name="contact"))
    level = supplied(supply, contact["end"])
    with at_level(level), np.errstate(all="raise", under="ignore"):
        outcomes = {id: check_outcomes(CLAIMS[id].function()) for id in sorted(CLAIMS)
                  if CLAIMS[id].of_wide and id not in LEFT_OUT and not CLAIMS[id].unjudged}
        entry = {**contact, "outlines": _outlines(), "claims": outcomes}
    forget(level)
    return entry


def supplied(supply: float, end: float) -> Level:
    """The level at which wide has a supply (K_s) and an end (h)."""
    changes = [f'substrates.{name}.supply="{supply:g} mg/L"' for name in ("acceptor", "donor")]
    return Level(CONVERGED, SIZE, wide=(*changes, f'growth.end="{end:g} h"'))


def check_outcomes(finding: Finding) -> dict[str, bool]:
    """{quantity without its numbers: does it hold?} for the checks that are not about base."""
    outcomes: dict[str, bool] = {}
    for check in finding.checks:
        name = unnumbered(check.quantity)
        if not name.startswith("base"):
            outcomes[name] = check.holds and outcomes.get(name, True)
    return outcomes


def _outlines() -> dict[str, str]:
    """Outlines by their hour: points "x,y x,y ..." to FINE (um), without points on a straight line between others."""
    return {f"{time:g}": _places(aggregate) for time, aggregate in zip(series(*WIDE)["time_h"], bodies(WIDE))
            if time % EVERY == 0}


def _places(aggregate) -> str:
    places = shapely.get_coordinates(shapely.simplify(polygon(aggregate.outline), FINE))
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in places)


def verdicts(by_supply: dict[str, dict]) -> tuple[list[str], list[str], list[str]]:
    """Claims that hold with all supplies, with some, and with none."""
    every: list[str] = []
    some: list[str] = []
    none: list[str] = []
    for id in next(iter(by_supply.values()))["claims"]:
        holds = [all(result["claims"][id].values()) for result in by_supply.values()]
        (every if all(holds) else some if any(holds) else none).append(id)
    return every, some, none


def moving(by_supply: dict[str, dict]) -> Iterator[tuple[str, list[bool]]]:
    """Whether each check holds with each supply, by claim and quantity; only checks that hold with some supplies and
    fail with others."""
    claims = [result["claims"] for result in by_supply.values()]
    for id in claims[0]:
        for quantity in claims[0][id]:
            holds = [outcomes[id][quantity] for outcomes in claims]
            if any(holds) and not all(holds):
                yield f"{id}, {quantity}", holds
