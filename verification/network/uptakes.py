"""Uptake of both substrates by aggregates in throats: solutions of drawn states, and the law `repro.uptake`.

A part of the states gives the constants of the law. The other part tests it.
"""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import numpy as np

from repro.march.ends import PoreEnd
from repro.march.folding import Fold
from repro.model import solving
from repro.model.meshing import seeded
from repro.model.pore import Pore
from repro.network import own
from repro.network.resistance import is_plug
from repro.network.uptakes import TRANSPORTS, Throats, Transport, table_1
from repro.results import read_table
from repro.scene import load_scene
from verification.claims.runs import SUBSTRATES
from verification.network import shapes
from verification.network.shapes import Growth, log_uniform, select

TABLE = Path(__file__).with_name("uptakes.csv")
#: Ranges of the mean velocity (m/d) and of the supply of each substrate (mg/L).
VELOCITIES, SUPPLIES = (1e-4, 10.0), (0.2, 20.0)
#: Ranges of the width (um) and of the thickness of half-discs over the width.
WIDTHS, THICKNESSES = (40.0, 150.0), (0.05, 0.98)
#: Parts of the states, and the seed of each.
FIT, NEW = 0, 1
SEEDS = {FIT: 20261126, NEW: 20261201}
#: Half-discs in each part.
HALF_DISCS = {FIT: 120, NEW: 25}
#: Runs in each part, and states at each of their shapes.
RUNS, STATES = {FIT: 4, NEW: 2}, {FIT: 3, NEW: 1}
#: The factor by which each shape of a run is larger than the one before, and the largest area over W^2.
APART, LARGEST = 1.2, 4.5
#: Number of grown shapes in NEW, drawn evenly from all of its runs.
NEW_GROWN = 25
#: Part by which the least sum of squares may be less than that of the law's constants. Few states are plugs, and the
#: halvings of the law's intervals move their sum of squares by up to a third.
FLAT = 0.25
#: The start of the fit: diffusion through a layer of a tenth of W, and water that is half mixed.
START = Transport(10.0, 0.5, 0.5, 0.5)


class State(NamedTuple):
    """An aggregate and its uptake.

    part: FIT or NEW; grown, spanned: 0 or 1; area: um2; width: um; velocity: m/d; acceptor, donor: supplies, mg/L;
    acceptor_uptake, donor_uptake: pg/m/h.
    """

    part: int
    grown: int
    spanned: int
    area: float
    width: float
    velocity: float
    acceptor: float
    donor: float
    acceptor_uptake: float
    donor_uptake: float


def states(part: int) -> Iterator[State]:
    """States of a part."""
    random = np.random.default_rng(SEEDS[part])
    for _ in range(HALF_DISCS[part]):
        width = log_uniform(random, *WIDTHS)
        body = shapes.half_disc(random.uniform(*THICKNESSES), width, 0.0, shapes.QUICK)
        yield solved(body, *_drawn(random), False, part)
    bodies = [body for _ in range(RUNS[part]) for body in _grown(shapes.drawn_run(random))]
    if part == NEW:
        bodies = [bodies[k] for k in np.linspace(0, len(bodies) - 1, NEW_GROWN).astype(int)]
    for body in bodies:
        for _ in range(STATES[part]):
            yield solved(body, *_drawn(random), True, part)


def read(part: int) -> dict[str, np.ndarray]:
    """The columns of the states of a part."""
    columns = read_table(TABLE)
    return select(columns, columns["part"] == part)


def throats(columns: dict[str, np.ndarray], transports: tuple[Transport, Transport] = TRANSPORTS) -> Throats:
    """The throats of some states."""
    supplies = np.array([columns[name] for name in SUBSTRATES])
    law = table_1()._replace(transports=transports)
    return Throats(columns["area"], columns["width"], columns["velocity"], supplies, law)


def solutions(columns: dict[str, np.ndarray]) -> np.ndarray:
    """(2, n) the uptakes of acceptor and donor."""
    return np.array([columns[f"{name}_uptake"] for name in SUBSTRATES])


def fitted(columns: dict[str, np.ndarray]) -> tuple[Transport, Transport]:
    """The constants before and after contact."""
    spanned = is_plug(throats(columns).share)
    before, after = (select(columns, rows) for rows in (~spanned, spanned))
    return own.fit(throats(before), solutions(before), START), own.fit(throats(after), solutions(after), START)


def misfit(columns: dict[str, np.ndarray], transports: tuple[Transport, Transport]) -> np.ndarray:
    """(2,) sums, before contact and after it, of the squares that the fit minimises."""
    law = throats(columns, transports)
    squares = ((own.deviations(law, solutions(columns)) / law.spread())**2).sum(axis=0)
    spanned = is_plug(law.share)
    return np.array([squares[~spanned].sum(), squares[spanned].sum()])


def is_fit(columns: dict[str, np.ndarray], transports: tuple[Transport, Transport]) -> bool:
    """Whether another fit has sums of squares that are less by at most the part ``FLAT``."""
    return bool((misfit(columns, transports) <= (1 + FLAT) * misfit(columns, fitted(columns))).all())


def bound(columns: dict[str, np.ndarray], transports: tuple[Transport, Transport]) -> float:
    """The law's least bound, to three digits."""
    return own.bound(throats(columns, transports), solutions(columns))


def judged(part: int = NEW) -> tuple[np.ndarray, np.ndarray]:
    """(n,) the larger relative deviation of acceptor and donor from the law, and (n,) its bound."""
    columns = read(part)
    law = throats(columns)
    return np.expm1(np.abs(own.deviations(law, solutions(columns)))).max(axis=0), law.bound()


def _grown(run: Growth) -> Iterator[Pore]:
    """Shapes of a run, which may end at the pore's end or as a fold."""
    with suppress(PoreEnd, Fold):
        yield from shapes.grown(run, LARGEST, APART)


def solved(body: Pore, velocity: float, supplies: Sequence[float], grown: bool = False, part: int = FIT) -> State:
    """The uptake of an aggregate at a mean velocity (m/d) and supplies of acceptor and donor (mg/L)."""
    width = body.mesh.width
    tables = shapes.tables(width, {"radius": f"{0.1 * width} um"}, velocity)
    tables["substrates"] = {name: {"supply": f"{supply} mg/L"} for name, supply in zip(SUBSTRATES, supplies)}
    scene = load_scene({**tables, "growth": {"end": "0 h"}}, shapes.QUICK)
    if not grown:
        body = seeded(scene, outline=body.boundary)
    acceptor, donor = solving.solve(scene, body).substrates.fluxes
    return State(part, int(grown), int(body.contact), body.boundary.area, width, velocity, *supplies,
                 acceptor.consumed, donor.consumed)


def _drawn(random: np.random.Generator) -> tuple[float, list[float]]:
    """A velocity, and supplies of both substrates."""
    return log_uniform(random, *VELOCITIES), [log_uniform(random, *SUPPLIES) for _ in SUBSTRATES]
