"""A surface that growth compresses too far ends a run like the pore's end does. Under less compression a failure is an
error.

The scene is a plug between the walls that grows uniformly. Its free surfaces keep their length, so their elastic
stretch is theta^(-1/2)."""
import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import repro
from repro.errors import GrowthError, LinearError, MeshError, SimulationError
from repro.march import loop
from repro.march.balance import Ledger
from repro.march.ends import Ends, nearest_end
from repro.march.folding import most_compressed, refuse_density
from repro.march.loop import Stepping
from repro.march.state import Compression, InterpolatedState, RestartState, StepResult
from repro.march.step_control import StepControl
from repro.model import contact
from repro.model.configuration import FromPrevious
from repro.model.energies.neo_hookean import BIOT, CREASE
from repro.model.mechanics import Mechanics
from repro.model.meshing import seeded
from repro.model.solving import solve
from repro.model.surface import surface
from repro.preflight.simplifications import warn_surface
from repro.scene import load_scene

SETS = ('numerics.preset="fast"', "numerics.refinement=0.3", 'pore.width="20 um"', 'growth.end="6 h"',
        'aggregate.outline=[["-10 um", "0 um"], ["-10 um", "20 um"], ["10 um", "20 um"], ["10 um", "0 um"]]',
        'substrates.acceptor.supply="1e6 mg/L"', 'substrates.donor.supply="1e6 mg/L"',
        'output.times=["1 h", "4.6 h", "6 h"]')


@cache
def plug(*changes):
    return load_scene("base", [*SETS, *changes], unset=["aggregate.radius"])


@cache
def compressed(theta):
    """The plug after uniform growth by theta, with the concentrations in its new shape."""
    scene = plug()
    seed = seeded(scene)
    pore = contact.expand(Mechanics.of(scene), seed, [np.full_like(seed.body.theta, theta)]).pore
    pore = replace(pore.with_masses(theta * pore.active, theta * pore.inert), time=1.0)
    return replace(pore, concentrations=solve(scene, pore).concentrations)


def continue_run(theta, advance, earlier=None):
    """Return the error and the rows of a run that continues from the compressed plug with the steps of ``advance``.

    earlier: theta of the most compressed plug of the run; None: the present one.
    """
    rows = []
    compression = most_compressed(Compression(), compressed(earlier or theta))
    start = RestartState(compressed(theta), StepControl(1.0), compression=compression)
    with pytest.raises((repro.Fold, SimulationError)) as ending:
        rows.extend(instant for _, instant in loop.steps(plug(), Stepping(advance, None), start) if instant)
    return ending.value, rows


@pytest.mark.parametrize("error, theta, kind", [
    (GrowthError, 2.175, repro.Fold), (MeshError, 2.175, repro.Fold), (LinearError, 3.0, SimulationError),
    (GrowthError, 2.15, SimulationError), (MeshError, 2.15, SimulationError)])
def test_a_failed_step_is_a_fold_only_if_the_surface_creases(error, theta, kind):
    """The thetas are 0.6 % from that of a stretch of 0.68."""
    def advance(scene, pore, solved, step_control):
        raise error("no")

    ending, rows = continue_run(theta, advance)
    assert type(ending) is kind and not rows
    assert ("folds in the step from t = 1 h: " in str(ending)) == (kind is repro.Fold)


def test_the_least_stretch_of_a_run_stays():
    """It stays when the surface is less compressed later, and after a row. Where strain counts from the last shape, it
    does not stay."""
    creased = most_compressed(Compression(), compressed(3.0))
    state = RestartState(compressed(3.0), StepControl(1.0), compression=creased)
    assert loop.mark_reported(state, 1.0).compression == creased
    later = compressed(1.5)
    assert most_compressed(creased, later) == creased
    restarted = most_compressed(creased, later.with_body(configuration=FromPrevious(later.body.reference)))
    assert restarted.stretch == surface(later).least > creased.stretch


def test_a_failed_step_of_a_buckled_surface_is_a_fold():
    """The present stretch is 1, since buckles have released the compression. The least stretch so far decides."""
    def advance(scene, pore, solved, step_control):
        assert surface(pore).least > 0.99
        raise GrowthError("no")

    ending, rows = continue_run(1.0, advance, earlier=3.0)
    assert type(ending) is repro.Fold and not rows
    assert re.search(f"compressed it to an elastic stretch of {3**-0.5:.3f} near .* at t = 1 h;", str(ending))


def multiplied(factor, pore, within):
    """A step to the run's end with ``factor`` times the biomass in the same shape, which no balance notices."""
    after = replace(pore.with_masses(factor * pore.active, factor * pore.inert), time=6.0)
    none = (0.0, 0.0)
    ledger = Ledger(1.0, 6.0, none, none, none, none, after.mass, 0.0, after.mass)
    return StepResult(after, None, ledger, False, 0, within)


@pytest.mark.parametrize("theta", [2.35, 2.42])
def test_the_warning_of_creases_begins_at_their_stretch(theta):
    """The stretches are 0.8 % above and 0.6 % below 0.647."""
    assert bool(list(warn_surface(compressed(theta)))) == (theta**-0.5 < CREASE)


@pytest.mark.parametrize("theta", [3.35, 3.41])
def test_the_surface_folds_below_biots_limit_and_not_above(theta):
    """The stretches are 0.4 % above and 0.5 % below 0.544."""
    assert (nearest_end(Ends.of(plug()), compressed(theta), None).margin > 0) == (theta**-0.5 < BIOT)


@pytest.mark.parametrize("factor", [0.52, 1.94])
def test_a_density_just_within_its_bounds_is_accepted(factor):
    pore = multiplied(factor, compressed(1.5), None).pore
    assert refuse_density(pore, pore, plug().kinetics.maximum_density) is None


@pytest.mark.parametrize("theta, kind", [(3.0, repro.Fold), (1.5, SimulationError)])
@pytest.mark.parametrize("factor", [0.48, 2.06])
def test_no_step_has_a_density_out_of_bounds(theta, kind, factor):
    def too_dense(scene, pore, solved, step_control):
        step = multiplied(factor, pore, lambda time: InterpolatedState(replace(pore, time=time), solved))
        return step, solved, step_control

    ending, rows = continue_run(theta, too_dense)
    assert type(ending) is kind and not rows
    assert kind is repro.Fold or f"{factor:.2g} X_m, out of 0.5 to 2" in str(ending)


@pytest.mark.parametrize("failure, message", [
    (0.4, "0.4 to 0.4 X_m"), (2.5, "2.5 to 2.5 X_m"), (GrowthError("no rest"), "no rest"),
    (repro.PoreEnd("too close"), "too close"), (FloatingPointError("overflow"), "overflow")])
def test_a_row_that_cannot_be_computed_is_left_out(failure, message):
    """A state has its time and the reason. The run goes on and reaches its end."""
    def advance(scene, pore, solved, step_control):
        def within(time):
            if not isinstance(failure, float):
                raise failure
            return InterpolatedState(replace(multiplied(failure, pore, None).pore, time=time), solved)

        return multiplied(1.0, pore, within), solved, step_control

    start = RestartState(compressed(1.5), StepControl(1.0))
    states = list(loop.steps(plug(), Stepping(advance, None), start))
    missing = [state.missing for state, _ in states if state.missing]
    assert [time for time, _ in missing] == [4.6] and message in missing[0][1]
    assert [report.pore.time for _, report in states if report] == [6.0]


@pytest.mark.parametrize("theta", [1.5, 3.0])
def test_distances_on_a_surface_count_from_its_contact_lines(theta):
    """The plug has two free surfaces. The distance of an edge is that to the nearer end of its surface, over its
    length."""
    profile = surface(compressed(theta))
    upstream = profile.middles[:, 0] < 0
    for side in (upstream, ~upstream):
        y = profile.middles[side, 1] / 20.0
        assert profile.distance[side] == pytest.approx(np.minimum(y, 1 - y), abs=1e-12)
    assert upstream.any() and (~upstream).any() and profile.place[1] in profile.middles[:, 1]
