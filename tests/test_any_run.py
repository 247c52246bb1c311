"""What holds for a run of any scene: when its steps end, its growth by the biomass made, no matter what an hour is."""
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from repro.errors import SimulationError, Unresolved
from repro.march import updates
from repro.march.simulation import simulate
from tests import oracles
from tests.strategies import ORDERS, between, scene, scenes, share

ANY_ORDER = tuple(ORDERS.values())


def run(made):
    """All instants, or none where a mesh of higher order is too coarse and says so."""
    try:
        return list(simulate(made))
    except SimulationError as error:
        assert made.numerics.order > 1 and isinstance(error.__cause__, Unresolved)
        return []


@given(between(1e-3, 1e3), between(0.01, 1000.0), st.lists(st.floats(0.0, 1.0), max_size=5))
def test_steps_are_no_longer_than_asked_and_end_where_they_should(step, count, parts):
    """From 0 to the end, ever later, each at most a time step long, at every output time; at most one step more for
    each of these than the end needs."""
    end = step * min(count, 300.0)
    wanted = sorted({part * end for part in parts})
    more = {"output": {"times": [f"{time!r} h" for time in wanted]}} if wanted else {}
    made = scene(velocity="1 m/day", growth={"end": f"{end!r} h", "time_step": f"{step!r} h"}, **more)
    times, reported = updates.schedule(made)
    assert times[0] == 0 and times[-1] == pytest.approx(end, rel=1e-12)
    assert (np.diff(times) > 0).all() and np.diff(times).max() <= step * (1 + 1e-9) + 2e-9
    assert len(times) <= np.ceil(end / step) + len(wanted) + 2
    assert reported == ({0.0, *wanted} if wanted else set(times))


@share(0.4)
@given(scenes(steps=1, elements=ANY_ORDER))
def test_the_aggregate_grows_by_the_biomass_made(made):
    """In the first step, where J was one: (28)-(29) and (24) in the mean make its area larger by the biomass made over
    X_m, to round-off, and shrink it likewise; a film that closes takes no area."""
    found = run(made)
    if not found:
        return
    first, last = found
    (row,) = last.ledgers
    grown = last.pore.mesh.area()
    if made.numerics.order == 1:
        grown = oracles.mass(last.pore.mesh.points, last.pore.mesh.triangles[last.pore.mesh.biomass],
                             np.ones(len(last.pore.mesh.points)))
    assert grown == pytest.approx(first.pore.outline.area + row.biomass_made / made.kinetics.maximum_density, rel=1e-10)
    assert grown == pytest.approx(last.pore.outline.area, rel=1e-12)


@share(0.4)
@given(scenes(steps=1, elements=ANY_ORDER), between(1e-3, 1e3))
def test_the_unit_of_time_does_not_matter(made, unit):
    """All rates times a factor and all times over it: the same shapes, substrates and biomass."""
    for one, other in zip(run(made), run(faster(made, unit)), strict=True):
        assert other.pore.time * unit == pytest.approx(one.pore.time, rel=1e-12)
        assert other.pore.outline.points == pytest.approx(one.pore.outline.points, abs=1e-7 * made.pore.width)
        for name, size in (("acceptor", made.substrates.acceptor.supply), ("donor", made.substrates.donor.supply)):
            fields = [getattr(instant.solved.concentrations, name) for instant in (one, other)]
            assert fields[1] == pytest.approx(fields[0], abs=1e-7 * size)
        assert other.pore.active == pytest.approx(one.pore.active, rel=1e-7)


def faster(made, unit):
    """The scene in which everything goes ``unit`` times faster."""
    def times(section, factor, *names):
        changes = {name: factor * getattr(section, name) for name in names if getattr(section, name) is not None}
        return replace(section, **changes)

    diffusing = [times(s, unit, "diffusivity", "diffusivity_in_aggregate")
                 for s in (made.substrates.acceptor, made.substrates.donor)]
    carried = made.flow and times(times(made.flow, unit, "mean_velocity"), 1 / unit, "kinematic_viscosity")
    return replace(made, flow=carried, substrates=replace(made.substrates, acceptor=diffusing[0], donor=diffusing[1]),
                   kinetics=times(made.kinetics, unit, "maximum_utilization_rate", "decay_coefficient"),
                   growth=times(made.growth, 1 / unit, "end", "time_step"))
