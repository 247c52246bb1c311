"""Wide, whose supply the paper does not print: how well it is known after its contact with the opposite wall, and what
5 to 40 K_s of both substrates make of it.

**After contact**: conductivity, tips, and length of contact, in the mean, 5 h after contact and at 45 h. A contact
surface grows by whole edges of the outline, so that a single row jumps, by an edge or two, with whatever moves the
instant at which a node joins. Its mean over the whole hours from contact to the end of Figure 6 does not. The bar is
that of `verification.uncertainty` from the converged solution on four sizes of elements and steps. These were 0.5 to
sqrt(2) once; twice a size was added at the fine end and the coarsest left out: that of sqrt(2), whose conductivity at
45 h is 0.4 % off where the next four differ by 0.15 %, and that of 1, 0.5 % off at 39 h where the others differ by
0.11 %.

**Supplies**: for each, when contact comes, outlines every 5 h until as long after contact as Figure 6 goes on, or until
the aggregate reaches an end of the pore, and which of the claims about wide hold then. Those are the functions of
`verification.claims` themselves, with the converged solution at one size, so that a number has no bar here; a claim
holds where all of its checks about wide do."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from math import floor

import numpy as np
import shapely

from repro.errors import RunEnd
from repro.fem.outline import TOP
from repro.march import simulation
from repro.march.loop import Instant, State
from repro.results import M_PER_D
from verification.claims import CLAIMS, Finding, evaluate
from verification.claims.evaluate import MESH_ORDERS, unnumbered
from verification.claims.growth_pattern import contact_length
from verification.claims.levels import CONVERGED, Level, at_level, converged, forget
from verification.claims.runs import WIDE, bodies, ending, polygon, series
from verification.sensitivity.rounding import OF, Row, Runs, column, scene, touching
from verification.uncertainty import estimate

SIZES = (0.25, 2**-1.5, 0.5, 2**-0.5)
#: Whole hours (h) after contact, which comes at 34.3 h.
HOURS = tuple(map(float, range(35, 46)))
#: The whole hour that is 5 h after contact.
LATER = 39.0
#: How the numbers are called: means over HOURS, those at LATER, and those at the last of HOURS.
KINDS = ("mean of", f"{LATER:g} h:", "last")
#: What is asked of the bars, in percent of the number.
ASKED = {"conductivity (m/d)": 1.0, "upstream tip (um)": 1.0, "downstream tip (um)": 1.0, "length of contact (um)": 2.0}


def of_after(said) -> Row:
    """Means over HOURS (geometric, of magnitudes), values at LATER and at the last of them. Raises LookupError where
    one of the hours is before contact."""
    after = [instant for _, instant in simulation.steps(said) if instant and instant.pore.contact]
    if len(after) != len(HOURS):
        raise LookupError(f"{len(after)} of {len(HOURS)} rows are after contact")
    table = np.array([_row(each) for each in after])
    means = np.exp(np.log(np.abs(table)).mean(axis=0))
    rows = zip(KINDS, (means, table[HOURS.index(LATER)], table[-1]))
    return {f"{kind} {name}": float(abs(value)) for kind, row in rows for name, value in zip(ASKED, row)}


def _row(now: Instant) -> list[float]:
    """In the order of ASKED."""
    outline = now.pore.boundary
    return [M_PER_D * now.solved.flow.conductivity, outline.upstream, outline.downstream, contact_length(outline, TOP)]


OF["after contact"] = of_after


def after_contact(runs: Runs) -> list[dict]:
    """Each number on all sizes, its bar (%), and whether that is what is asked."""
    plain = (ending(scene("wide", {}, *converged(size)), *HOURS) for size in SIZES)
    rows = runs.get_all(replace(said, name="after contact") for said in plain)
    return [_bar_of(rows, f"{kind} {name}", asked) for kind, (name, asked) in product(KINDS, ASKED.items())]


def _bar_of(rows: list[Row], quantity: str, asked: float) -> dict:
    """A number from what runs on SIZES come to."""
    values = column(rows, quantity)
    bar = 100 * estimate(SIZES, values, MESH_ORDERS).bar / abs(values[0])
    return {"quantity": quantity, "values": values, "bar_percent": bar, "asked_percent": asked, "kept": bar <= asked}


#: Supplies over K_s, and the size of the converged solution's elements and steps.
SUPPLIES, SIZE = (5.0, 10.0, 20.0, 40.0), 2**0.5
#: Hours by which all of them have made contact.
END = 120.0
#: Claims that read this run and are not judged anew, since they compare it with what is not Figure 6's, and why.
LEFT_OUT = {"C32": "compares two ways for biomass to be born", "C41": "changes the rheology and the walls",
            "C42": "puts a permeable body in the place of a viscous one",
            "C44": "holds a law for networks, made of other shapes, against it",
            "C45": "compares its shapes with layers",
            "C46": "compares its stresses with and without the fluid's forces"}
#: Hours before it reaches an end of the pore at which an aggregate is still clear of it.
MARGIN = 0.1
#: Whole hours that wide goes on after contact: 45 h for Figure 6's own 10 K_s.
AFTER = 11
#: Hours between outlines; um to which these are kept.
EVERY, FINE = 5, 0.1


def of_contact(said) -> dict[str, float]:
    """Time of contact (h), the state's ends (um), the smallest acceptor in it (K_s), and the whole hour, AFTER contact
    at the latest, that a run comes to before the aggregate reaches an end of the pore."""
    said = ending(said, END)
    state = touching(said)
    last = float(floor(state.pore.time) + AFTER)
    outline, acceptor = state.pore.boundary, state.pore.concentrations.acceptor
    return {"contact_time": state.pore.time, "upstream": outline.upstream, "downstream": outline.downstream,
            "acceptor_min": float(acceptor.min()) / said.substrates.acceptor.half_saturation,
            "end": float(floor(reached(ending(said, last), state)))}


def reached(said, state: State) -> float:
    """The time (h) to which a run goes on from a state: its end, or MARGIN before the aggregate reaches the pore's."""
    time = state.pore.time
    try:
        for now, _ in simulation.steps(said, state):
            time = now.pore.time
    except RunEnd:
        return time - MARGIN
    return said.growth.end


OF["contact"] = of_contact


def contacts(runs: Runs) -> dict[str, dict]:
    """By the supply over K_s: what `of_contact` tells, outlines, and which claims about wide hold."""
    evaluate.register_all()
    return {f"{supply:g}": _of_supply(runs, supply) for supply in SUPPLIES}


def _of_supply(runs: Runs, supply: float) -> dict:
    print(f"wide: a supply of {supply:g} K_s", flush=True)
    factors = {"supply of acceptor": supply / 10, "supply of donor": supply / 10}
    contact = runs.get(replace(scene("wide", factors, *converged(SIZE)), name="contact"))
    level = supplied(supply, contact["end"])
    with at_level(level), np.errstate(all="raise", under="ignore"):
        judged = {id: holding(CLAIMS[id].function()) for id in sorted(CLAIMS)
                  if CLAIMS[id].of_wide and id not in LEFT_OUT}
        found = {**contact, "outlines": _outlines(), "claims": judged}
    forget(level)
    return found


def supplied(supply: float, end: float) -> Level:
    """The level at which wide has a supply (K_s) and an end (h)."""
    changes = [f'substrates.{name}.supply="{supply:g} mg/L"' for name in ("acceptor", "donor")]
    return Level(CONVERGED, SIZE, wide=(*changes, f'growth.end="{end:g} h"'))


def holding(finding: Finding) -> dict[str, bool]:
    """Whether each check holds that is not about base, by its quantity without numbers, whose instants differ."""
    found: dict[str, bool] = {}
    for check in finding.checks:
        name = unnumbered(check.quantity)
        if not name.startswith("base"):
            found[name] = check.holds and found.get(name, True)
    return found


def _outlines() -> dict[str, str]:
    """Outlines by their hour: places "x,y x,y ..." to FINE (um), without those that lie on a straight line."""
    return {f"{time:g}": _places(found) for time, found in zip(series(*WIDE)["time_h"], bodies(WIDE))
            if time % EVERY == 0}


def _places(found) -> str:
    places = shapely.get_coordinates(shapely.simplify(polygon(found.outline), FINE))
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in places)


def verdicts(found: dict[str, dict]) -> tuple[list[str], list[str], list[str]]:
    """Claims that hold with all supplies, with some, and with none."""
    every: list[str] = []
    some: list[str] = []
    none: list[str] = []
    for id in next(iter(found.values()))["claims"]:
        held = [all(known["claims"][id].values()) for known in found.values()]
        (every if all(held) else some if any(held) else none).append(id)
    return every, some, none


def moving(found: dict[str, dict]) -> Iterator[tuple[str, list[bool]]]:
    """Checks, by claim and quantity, that hold with some supplies and not with all: whether they do with each."""
    claims = [known["claims"] for known in found.values()]
    for id in claims[0]:
        for quantity in claims[0][id]:
            held = [judged[id][quantity] for judged in claims]
            if any(held) and not all(held):
                yield f"{id}, {quantity}", held
