"""The fluid's forces on the aggregate, when shape and flow do not agree; what they are, and runs with them, are the
cases coupling-traction."""
import pytest

from repro.errors import GrowthError, StageError
from repro.model import contact, pore
from repro.scene import load_scene
from tests.strategies import ORDERS


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("density, rounds, error, said", [
    ("1e9 mg/cm^3", contact.FORCE_ROUNDS, StageError, "try a|helps a coarse"),
    ("998 mg/cm^3", 1, GrowthError, "do not agree after 1 rounds, a node still moves by .* um: .*try a shorter")])
def test_a_shape_that_the_forces_do_not_let_rest_is_refused(monkeypatch, density, rounds, error, said, order):
    """In water whose pressure is a thousand times the stiffness, or where rounds do not end: an error that says what to
    do, neither a hang nor a shape."""
    monkeypatch.setattr(contact, "FORCE_ROUNDS", rounds)
    made = load_scene("base", ["numerics.preset=paper", f"numerics.elements={ORDERS[order]}",
                               f"numerics.refinement={0.6 if order == 1 else 0.3}", "growth.time_step=24 min",
                               "growth.fluid_forces=included", f"flow.density={density}"])
    now = pore.seeded(made)
    with pytest.raises(error, match=said):
        contact.expand(made, now, 1.1 * now.theta)
