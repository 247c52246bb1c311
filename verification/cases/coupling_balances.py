"""Balances of runs and of single steps: substrates, biomass, the yield that links them, and X_m times the area.

The balances of substrates and biomass may close on wrong amounts, for instance if a step's ledger takes the flows of
its start. The balance of growth against uptake, and a run with shorter steps, detect this.

Short runs cover contact with the opposite wall and a wedge that closes (2.3.3).
"""

from collections.abc import Iterable
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from repro.fem.walls import BOTTOM, FREE
from repro.march.balance import Ledger
from repro.march.simulation import simulate
from repro.march.state import Report
from repro.model import remeshing, solving
from repro.model.contact_lines import CLOSE
from repro.model.meshing import seeded
from repro.model.remeshing import Remeshing
from repro.scene import Scene, load_scene
from verification.evidence.cases import parametrize
from verification.evidence.checks import Check, Study, at_least, at_most, between, study
from verification.problems import aggregates, runs

#: Steps twice as long as the paper's.
LONG = 'growth.time_step="24 min"'


@pytest.mark.case(
    "coupling-ledger", kind="property",
    mutants=("theta-anew-at-a-remesh", "biomass-interpolated-at-a-remesh", "growth-spread-evenly"), runs_with="paper")
@parametrize(
    "area, density, remeshes, *changes",
    {"linear": (6e-7, 4e-3, 3.0, LONG),
     "quadratic": (1e-10, 1e-3, 2.0, LONG, runs.with_elements("quadratic"), "numerics.refinement=0.2"),
     **{kind: (1e-10, 1e-3, 2.0, runs.with_preset(kind)) for kind in runs.QUADRATIC}})
def test_ledger(area, density, remeshes, changes, record):
    """Over a whole run with remeshes the balances of substrates and biomass close to round-off, and the area is the
    biomass over X_m.

    Norm: base to 19.4 h in steps of 24 min: worst step of both substrates' balances and of the biomass', relative; X_m
    times the area over the biomass; largest deviation of the density from X_m.

    area, density: bounds of their deviations; remeshes: the fewest.
    """
    scene = runs.base("19.4 h", *changes)
    instants = list(simulate(scene))
    rows, last = _ledgers(instants), instants[-1]
    growth = sum(row.biomass_made for row in rows)
    record(_steps(rows),
           at_most("biomass, whole run", abs((rows[0].biomass_before + growth) / rows[-1].biomass_after - 1),
                   1e-10, runs.ROUND_OFF),
           _area(scene, last, area, "J = theta in the mean: to the stabilisation of linear elements, else to Newton's "
                 "tolerance"),
           at_most("density", runs.density_drift(scene, last), density,
                   "J = theta in the mean around a node only [E7]; worked off at each remesh"),
           at_least("remeshes", last.remeshes, remeshes, "else they are not tested"))


def _steps(rows: list[Ledger], equations: float = 1000) -> list[Check]:
    """Checks of the worst step: substrates, biomass, and its start against the end of the step before.

    equations: number of equations of a substrate times the largest term of a row over the supplied mass.
    """
    gaps = [abs(next_step.biomass_before / step.biomass_after - 1) for step, next_step in pairwise(rows)]
    return [at_most("substrates", runs.substrate_defect(rows), 1e-13 * equations,
                    "Newton's tolerance, 1e-13 of the largest term of each row, over all rows"),
            at_most("biomass, worst step", np.max([runs.biomass_defect(rows), *gaps]), 1e-10, runs.ROUND_OFF)]


STEPS = (0.8, 0.4, 0.2, 0.1)


REFINEMENTS = (0.7, 1.0, 1.4, 2.0)


@pytest.mark.case(
    "coupling-density-restored", kind="property", mutants=("density-not-worked-off", "theta-anew-at-a-remesh"),
    runs_with="paper")
@parametrize("*changes", runs.every(0.5))
def test_density_restored(changes, record):
    """The next update removes the error of the density at a remesh [E7]: the density returns to X_m.

    Norm: a half-disc of 20 um whose density is X_m (1 + 0.1 x / R), remeshed, one step without uptake or decay: L2 of
    (X_A + X_I) / X_m - 1 over it; X_m times the area over the biomass, less 1.

    Record the order of linear elements, and the errors of the others.
    """
    if runs.base("1 h", *changes).numerics.scheme.order > 1:
        error, area = _restored(*changes)
        record(at_most("density", error, 1e-10,
                       "the masses of a new mesh are X_m, and J = theta in each point that the elements allow"))
    else:
        errors, areas = zip(*(_restored(*changes, f"numerics.refinement={refinement}") for refinement in REFINEMENTS))
        area = max(areas)
        record(study("density", 1 / np.array(REFINEMENTS), errors, 1.5,
                     "theta of triangles against X of nodes: second order inside, first order at the rim, where "
                     "triangles lie on one side of a node; 3/2 in L2", ceiling=1.2e-3))
    record(at_most("X_m times the area", area, 1e-11, runs.ROUND_OFF))


def _restored(*changes: str) -> tuple[float, float]:
    """L2 of the density's error, and X_m times the area over the biomass, less 1."""
    scene = runs.base("1 h", 'kinetics.decay_coefficient="0 1/d"', 'kinetics.maximum_utilization_rate="0 1/d"',
                      'aggregate.radius="20 um"', *changes)
    state = seeded(scene)
    x = aggregates.reaction_points(state.space)[0]
    state = state.with_body(active=state.active * (1 + 0.1 * x / scene.aggregate.radius))
    solved = solving.solve(scene, state)
    new_pore = remeshing.remesh(Remeshing.of(scene), state, state, solved.flow.mean_velocity)[0]
    after = runs.step(scene, new_pore, solving.solve(scene, new_pore), 0.2).pore
    weight, density = after.space.reaction.dx, runs.density(scene, after)
    error = np.sqrt(np.average((density - 1) ** 2, weights=weight))
    return error, abs(np.vdot(weight, density) / after.outline.area - 1)


#: Round-off and Newton's tolerance, 1e-13 of the largest term of each row, over all rows, with a margin.
CLOSED, CLOSES = 1e-9, "identities of the discrete equations: round-off and Newton's tolerance, with a margin"
#: Time (h) that a run continues after contact.
PAST = 2.0


def _yield_defect(scene: Scene, ledgers: list[Ledger]) -> float:
    """Relative defect of the yield in the worst step: |new - (grown - decayed)| / max(grown, decayed)."""
    production = np.array([step.biomass_made for step in ledgers])
    grown, decayed = np.array([runs.worth(scene.kinetics, step) for step in ledgers]).T
    return np.max(np.abs(production - (grown - decayed)) / np.maximum(np.abs(grown), np.abs(decayed)))


def _closed(scene: Scene, ledgers: list[Ledger]) -> list:
    """Checks of the worst step of a run."""
    bound, why = YIELD_BOUNDS.get((scene.numerics.transport, scene.numerics.scheme.steps), (CLOSED, CLOSES))
    return [at_most("substrates", runs.substrate_defect(ledgers), CLOSED, CLOSES),
            at_most("biomass", runs.biomass_defect(ledgers), CLOSED, CLOSES),
            at_most("new biomass against uptake", _yield_defect(scene, ledgers), bound, why)]


TRAPEZOIDAL = "trapezoidal rule on an exponential: (r step)^2 / 12, 1.2e-4 at the supply's rate"
#: Bounds of the yield's defect in a step of 12 min of the paper's schemes. Updates weigh the rates of both ends alike,
#: and grow by their mean.
YIELD_BOUNDS = {("quasi_steady", "updates"): (2e-4, TRAPEZOIDAL),
                ("gear", "updates"): (1e-3, "the tolerance of Gear, 0.1 %")}
HEUN = "Heun's method, and the trapezoidal rule for the consumption: second order"


def _of_base(preset: str):
    """Checks of base. For updates, the worst step has a lower bound too, and an order in the step size."""
    scene, ledgers, remeshes = _base(preset, STEPS[2])
    yield _closed(scene, ledgers)
    if not scene.numerics.scheme.controls_error:
        expected = (runs.growth_rates(scene.kinetics, scene.substrates)[0] * STEPS[2]) ** 2 / 12
        yield between("new biomass against uptake, over (r step)^2 / 12", _yield_defect(scene, ledgers) / expected,
                      0.95, 1.0, "r at the supply; that of the seed is 1 % lower, and falls as the pore clogs")
        yield _order([_base(preset, step)[:2] for step in STEPS])
    yield at_least("remeshes", remeshes, 1.0, "else they are not tested")


@cache
def _base(preset: str, step: float) -> tuple[Scene, list[Ledger], int]:
    """Base with updates, or a first step, of so many hours; its ledgers and number of remeshes."""
    scene = runs.base("19.4 h", runs.with_preset(preset), f'growth.time_step="{60 * step:g} min"')
    instants = list(simulate(scene))
    return scene, _ledgers(instants), sum(instant.remeshes for instant in instants)


def _of_narrow(preset: str):
    """Checks of a pore of 40 um through contact."""
    scene = load_scene("base", ('growth.end="25 h"', runs.with_preset(preset), 'pore.width="40 um"'))
    scene = runs.at_velocity(scene, runs.SPEED)
    instants, touched = [], np.inf
    for instant in simulate(scene):
        instants.append(instant)
        touched = min(touched, instant.pore.time if instant.pore.contact else np.inf)
        if instant.pore.time >= touched + PAST:
            break
    yield _closed(scene, _ledgers(instants))
    yield at_least("hours after contact", instants[-1].pore.time - touched, PAST, "else less is tested")


def _ledgers(instants: Iterable[Report]) -> list[Ledger]:
    return [step for instant in instants for step in instant.ledgers]


def _short(elements: str, *changes: str) -> Scene:
    """Base from 20 um to 1.6 h, with any kind of elements."""
    return runs.base("1.6 h", runs.with_elements(elements), 'aggregate.radius="20 um"', *changes,
                     "numerics.refinement=0.5")


def _of_short(elements: str, change: str) -> list:
    """Checks of the midpoint rule, or of the paper's transient scheme."""
    scene = _short(elements, change)
    return _closed(scene, _ledgers(simulate(scene)))


def _of_updates(elements: str) -> Study:
    """Study of the worst step of the paper's updates over the step size."""
    scenes = [_short(elements, f'growth.time_step="{step} h"') for step in STEPS]
    return _order([(scene, _ledgers(simulate(scene))) for scene in scenes])


def _order(series: Iterable[tuple[Scene, list[Ledger]]]) -> Study:
    """Study of the yield's defect in the worst step of runs with step sizes STEPS."""
    errors = [_yield_defect(*run) for run in series]
    return study("new biomass against uptake, worst step", STEPS, errors, 2, HEUN, ceiling=4e-5, band=0.15)


#: Runs by label: base and a narrow pore by preset, a short run by scheme and elements.
BALANCED = {**{f"base, {preset}": (_of_base, preset) for preset in ("paper", *runs.QUADRATIC)},
            **{f"40 um, {preset}": (_of_narrow, preset) for preset in runs.PRESETS},
            **{f"{scheme}, {kind}": (judge, kind, *change) for kind in runs.ELEMENTS
               for scheme, judge, *change in (("midpoint rule", _of_short, runs.with_preset("fast")),
                                            ("gear", _of_short, 'numerics.transport="gear"'),
                                            ("updates", _of_updates))}}


@pytest.mark.slow
@pytest.mark.case(
    "coupling-one-balance", kind="property",
    mutants=("biomass-of-the-start-takes-up", "remesh-half-way-unmatched", "masses-of-the-start-kept",
             "flows-of-the-start", "euler-biomass", "rates-at-the-start", "rates-two-percent-low", "decay-leaves-all"))
@parametrize("judge, *arguments", BALANCED)
def test_one_balance(judge, arguments, record):
    """In every step supplied substrates leave, are consumed or are stored, the biomass changes by the new biomass, and
    the new biomass balances the uptake: to round-off with the midpoint rule, to second order with the paper's updates,
    and to 2e-4 in a step of 12 min over all of base.

    Norm: worst step of the ledger: |supplied - out - consumed - stored| over supplied, |after - before - new| over
    after, |new - (Y donor - (acceptor - F donor) / d_c)| over the larger of its two terms; base, and a pore of 40 um at
    2.9 m/d from a seed to 2 h after contact.
    """
    record(judge(*arguments))


def _area(scene: Scene, last: Report, bound: float = 3e-6, origin: str = "J = theta to the stabilisation") -> Check:
    total = scene.kinetics.maximum_density * last.pore.outline.area
    return at_most("X_m times the area", abs(total / last.ledgers[-1].biomass_after - 1), bound, origin)


@pytest.mark.slow
@pytest.mark.case("coupling-wedge", kind="property", mutants=("no-wedge-closes", "films-stay-open"), runs_with="paper")
@parametrize("*changes", runs.every(0.6))
def test_wedge(changes, record):
    """Wedges of fluid beside a contact surface close until they have the least contact angle.

    Norm: one step from a disc of 20 um that stands on a chord, the fluid under it at 8 degrees.
    """
    scene = runs.base("0.2 h", *changes)
    instants = list(simulate(scene, shape=_disc(20.0, 19.8, 60 * scene.numerics.scheme.order)))
    gaps = [_narrowest(scene, instant.pore, BOTTOM) for instant in instants]
    error = CLOSE if scene.numerics.scheme.order == 2 else 1e-9
    record(at_most("narrowest gap over the least allowed, seed", gaps[0], 0.9, "8 degrees are under 16.7"),
           at_least("the same after a step", gaps[1], 1 - error,
                    "2 um, or 16.7 degrees beside contact; on arcs the search ends at a clearance of CLOSE"),
           _area(scene, instants[-1]))


def _disc(radius: float, height: float, edges: int) -> np.ndarray:
    """(edges + 1, 2) um, points of a disc around (0, height) cut by the lower wall, from its upstream end."""
    start = np.arcsin(height / radius)
    angle = np.linspace(np.pi + start, -start, edges + 1)
    return runs.standing(radius * np.cos(angle), height + radius * np.sin(angle))


def _narrowest(scene: Scene, state, wall: int) -> float:
    """Least gap between a wall and the interface beyond the contact surface, over the allowed gap.

    The allowed gap is the smaller of the least film and tan(least angle) times the distance from contact. Without
    contact the result is zero.
    """
    outline, growth = state.outline, scene.growth
    free, contact_x = outline.points[outline.wall == FREE], outline.points[outline.wall == wall, 0]
    if len(contact_x) == 0:
        return 0.0
    along = np.maximum(contact_x.min() - free[:, 0], free[:, 0] - contact_x.max())
    gap = free[:, 1] if wall == BOTTOM else scene.pore.width - free[:, 1]
    allowed = np.minimum(growth.minimum_film, np.tan(growth.minimum_contact_angle) * along)
    return (gap[along > 0] / allowed[along > 0]).min()
