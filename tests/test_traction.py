"""The fluid's forces on the aggregate if shape and flow do not agree. The cases coupling-traction test the forces and
runs with them."""
import numpy as np
import pytest

from repro import simulate
from repro.errors import GrowthError, StageError
from repro.fem.walls import TOP
from repro.march.stepping import LANDED
from repro.model import contact, contact_lines, traction
from repro.model.mechanics import Mechanics
from repro.model.meshing import seeded
from tests.strategies import EVERY_ORDER, ORDERS
from verification.problems.schemes import exchange, load_scene


def dense_base(order, density):
    """Base with coarse elements of an order, in water of a density, and its seed."""
    scene = load_scene("base", ["numerics.preset=paper", exchange(elements=ORDERS[order]),
                               f"numerics.refinement={0.6 if order == 1 else 0.3}", "growth.time_step=24 min",
                               "growth.fluid_forces=included", f"flow.density={density}"])
    return scene, seeded(scene)


@EVERY_ORDER
def test_a_shape_without_equilibrium_under_the_forces_is_refused(order):
    """The pressure of the water is a thousand times the stiffness."""
    scene, seed = dense_base(order, "1e9 mg/cm^3")
    with pytest.raises(StageError, match="try a|crosses itself"):
        contact.expand(Mechanics.of(scene), seed, [1.1 * seed.body.theta])


@EVERY_ORDER
def test_the_first_row_is_in_equilibrium_under_the_forces(order):
    """The water moves the downstream tip by 0.012 um."""
    scene, seed = dense_base(order, "1e7 mg/cm^3")
    first = next(simulate(scene)).pore.boundary
    alone = contact.expand(Mechanics.of(scene), seed, [seed.body.theta]).pore.boundary
    assert first.downstream == pytest.approx(alone.downstream, abs=1e-6)
    assert first.downstream - seed.boundary.downstream > 5e-3


@pytest.mark.parametrize("noise, agrees", [(0.1, True), (1.0, False)])
@EVERY_ORDER
def test_rounds_that_do_not_reduce_the_move_end(monkeypatch, order, noise, agrees):
    """Forces that change at random at every node move the nodes by 3e-6 to 2e-5 of the thickness times the noise. Below
    1e-6 this counts as round-off, above it an error gives advice. The last round moves them by 2.6e-7 and 2.6e-6."""
    exact, random = traction.forces, np.random.default_rng(1)

    def noisy(*at):
        forces = exact(*at)
        return forces * (1 + noise * random.uniform(-1, 1, forces.shape))

    monkeypatch.setattr(traction, "forces", noisy)
    scene, seed = dense_base(order, "1e5 mg/cm^3")
    mechanics = Mechanics.of(scene)
    if agrees:
        assert contact.expand(mechanics, seed, [1.1 * seed.body.theta]).iterations > 0
        return
    with pytest.raises(GrowthError, match="do not agree: after .* rounds a node still moves by .* um, .*try a larger"):
        contact.expand(mechanics, seed, [1.1 * seed.body.theta])


@EVERY_ORDER
def test_a_closed_pore_may_have_larger_forces_than_the_open_one(monkeypatch, order):
    """A step ends where the film is 1.999 um thick, 1.998 to 2 are allowed. The closed pore's forces lift the
    aggregate without contact by more than 0.01 um. The contact stays nevertheless."""
    scene = load_scene("base", ["numerics.preset=fast", exchange(elements=ORDERS[order]), "pore.width=7.0487 um",
                                "numerics.contact_elements=0", "growth.fluid_forces=included"])
    seed = seeded(scene)

    def lifting(_fluid, _around, shaped):
        y = shaped.mesh.points[shaped.mesh.body, 1]
        return np.column_stack([np.zeros(len(y)), 0.01 * (y > 0.5 * y.max()) * shaped.contact])

    monkeypatch.setattr(traction, "forces", lifting)
    search = contact_lines.SearchOptions(landing=LANDED)
    closed = contact.expand(Mechanics.of(scene), seed, [1.02 * seed.body.theta], search=search)
    assert closed.pore.contact
    assert closed.gaps[1] < 1.99 < LANDED * scene.growth.minimum_film


def test_nodes_stay_on_a_wall_that_they_join_in_every_other_round(monkeypatch):
    """The forces lift the aggregate while one node at most is on the wall. Two more nodes then join, the forces vanish,
    and the two leave. Where two rounds have the same nodes on the wall, these stay. Shape and forces agree."""
    scene = load_scene("wide", ["numerics.preset=fast", exchange(elements="linear"), "pore.width=25 um",
                                "aggregate.radius=23 um", "numerics.contact_elements=0",
                                "growth.fluid_forces=included"])
    seed, counts = seeded(scene), []

    def lifting(_fluid, _around, shaped):
        y = shaped.mesh.points[shaped.mesh.body, 1]
        counts.append(int((shaped.body.wall == TOP).sum()))
        return np.column_stack([np.zeros(len(y)), 0.02 * (y > 0.5 * y.max()) * (counts[-1] < 2)])

    monkeypatch.setattr(traction, "forces", lifting)
    assert contact.expand(Mechanics.of(scene), seed, [1.03 * seed.body.theta]).pore.contact
    assert counts[1:4] == [3, 1, 3] and set(counts[4:]) == {3}


@pytest.mark.parametrize("gain", [-0.9, 0.3, 0.8, 0.95])
def test_rounds_agree_whatever_part_of_a_change_returns(gain):
    """Forces f and their response 1 + gain f agree at f = 1 / (1 - gain), in two modes, one with 0.9 of the gain. Two
    secants through the first three rounds solve two linear modes."""
    rounds, gains = contact._Rounds(), gain * np.array([1.0, 0.9])
    forces = np.zeros(2)
    for _ in range(5):
        forces = rounds.next_forces(1 + gains * forces)
    assert forces == pytest.approx(1 / (1 - gains), rel=1e-6)


@pytest.mark.parametrize("moves, stalled", [
    ([1.0] * 5, False), ([1.0] * 6, True),
    ([1.0, 0.1, 0.3, 0.2, 0.4, 0.2, 0.04, 0.1, 0.2, 0.3], False),
    ([1.0, 0.1, 0.3, 0.2, 0.4, 0.2, 0.06, 0.1, 0.2], True)])
def test_rounds_stall_if_the_least_move_does_not_halve(moves, stalled):
    """Moves may rise."""
    assert contact._Rounds(moves=moves).stalled is stalled
