"""The fluid's forces on the aggregate if shape and flow do not agree. The cases coupling-traction test the forces and
runs with them."""
import pytest

from repro.errors import GrowthError, StageError
from repro.model import contact, pore
from repro.scene import load_scene
from tests.strategies import ORDERS


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("density, rounds, error, message", [
    ("1e9 mg/cm^3", contact.FORCE_ROUNDS, StageError, "try a|crosses itself"),
    ("998 mg/cm^3", 1, GrowthError, "do not agree after 1 rounds, a node still moves by .* um: .*try a larger")])
def test_a_shape_without_equilibrium_under_the_forces_is_refused(monkeypatch, density, rounds, error, message, order):
    """If the pressure of the water is a thousand times the stiffness, or the rounds do not converge, an error gives
    advice."""
    monkeypatch.setattr(contact, "FORCE_ROUNDS", rounds)
    scene = load_scene("base", ["numerics.preset=paper", f"numerics.elements={ORDERS[order]}",
                               f"numerics.refinement={0.6 if order == 1 else 0.3}", "growth.time_step=24 min",
                               "growth.fluid_forces=included", f"flow.density={density}"])
    seed = pore.seeded(scene)
    with pytest.raises(error, match=message):
        contact.expand(contact.Mechanics.of(scene), seed, 1.1 * seed.theta)
