"""The fluid's forces on the aggregate if shape and flow do not agree. The cases coupling-traction test the forces and
runs with them."""
import numpy as np
import pytest

from repro.errors import GrowthError, StageError
from repro.model import contact, pore, traction
from repro.scene import load_scene
from tests.strategies import EVERY_ORDER, ORDERS


def dense_base(order, density):
    """Base with coarse elements of an order, in water of a density, and its seed."""
    scene = load_scene("base", ["numerics.preset=paper", f"numerics.elements={ORDERS[order]}",
                               f"numerics.refinement={0.6 if order == 1 else 0.3}", "growth.time_step=24 min",
                               "growth.fluid_forces=included", f"flow.density={density}"])
    return scene, pore.seeded(scene)


@EVERY_ORDER
def test_a_shape_without_equilibrium_under_the_forces_is_refused(order):
    """The pressure of the water is a thousand times the stiffness."""
    scene, seed = dense_base(order, "1e9 mg/cm^3")
    with pytest.raises(StageError, match="try a|crosses itself"):
        contact.expand(contact.Mechanics.of(scene), seed, 1.1 * seed.theta)


@pytest.mark.parametrize("noise, agrees", [(1e-2, True), (1.0, False)])
@EVERY_ORDER
def test_rounds_that_do_not_reduce_the_move_end(monkeypatch, order, noise, agrees):
    """Forces that change at random at every node move the nodes by 3e-5 of the thickness times the noise. Below 1e-6
    this counts as round-off, above it an error gives advice."""
    exact, random = traction.forces, np.random.default_rng(1)

    def noisy(*at):
        forces = exact(*at)
        return forces * (1 + noise * random.uniform(-1, 1, forces.shape))

    monkeypatch.setattr(traction, "forces", noisy)
    scene, seed = dense_base(order, "1e5 mg/cm^3")
    mechanics = contact.Mechanics.of(scene)
    if agrees:
        assert contact.expand(mechanics, seed, 1.1 * seed.theta).iterations > 0
        return
    with pytest.raises(GrowthError, match="do not agree: after .* rounds a node still moves by .* um, .*try a larger"):
        contact.expand(mechanics, seed, 1.1 * seed.theta)


@pytest.mark.parametrize("gain", [-0.9, 0.3, 0.8, 0.95])
def test_rounds_agree_whatever_part_of_a_change_returns(gain):
    """Forces f and their response 1 + gain f agree at f = 1 / (1 - gain), in two modes, one with half of the gain. If
    each round took the last response, 12 rounds would leave gain^12 of the error. The secant leaves a tenth of that."""
    rounds, exact = contact._Rounds(), 1 / (1 - gain * np.array([1.0, 0.5]))
    forces = np.zeros(2)
    for _ in range(12):
        forces = rounds.next_forces(1 + gain * np.array([1.0, 0.5]) * forces)
    assert forces == pytest.approx(exact, rel=max(1e-6, 0.1 * abs(gain) ** 12))
