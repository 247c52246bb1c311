"""Coupled runs with elements of every order: decay, contact, options.

Ledgers, symmetry, growth in closed form and orders in time are cases of the stage coupling.
"""
from dataclasses import replace

import numpy as np
import pytest

from repro.fem.outline import BOTTOM, TOP
from repro.march.simulation import simulate
from repro.model import contact, pore
from tests.strategies import ORDERS, scene

EVERY_ORDER = pytest.mark.parametrize("order", ORDERS)


def elements(order):
    """The paper's scheme with elements of an order, fewer of them the higher it is."""
    return {"elements": ORDERS[order], "refinement": {1: 1.0, 2: 0.4, 3: 0.3}[order]}


def run(made):
    """All instants of a scene."""
    return list(simulate(made))


#: Schemes and orders of elements, the midpoint rule with those of the size of preset fast.
WAYS = [("updates", 1), ("updates", 2), ("midpoint", 1), ("midpoint", 2)]


@pytest.fixture(scope="module", params=WAYS, ids=lambda way: f"{way[0]}-{way[1]}")
def touching(request):
    """An aggregate 0.1 um short of the film that closes, under a constant velocity: the scene, and its steps through
    contact."""
    time, order = request.param
    numerics = elements(order)
    if time == "midpoint":
        numerics |= {"preset": "fast", "refinement": 0.5 if order == 1 else 0.2}
    radius, growth = "17.9 um", {"end": "1 h"}
    if (time, order) == ("midpoint", 1):  # a film of 2 um would thin out the straight triangles beside it
        radius, growth = "18.9 um", {"end": "1 h", "minimum_film": "1 um"}
    made = scene(radius, "20 um", velocity="2.9 m/day", growth=growth, numerics=numerics)
    return made, [instant for instant in run(made) if instant.ledgers or instant.pore.time == 0]


@EVERY_ORDER
def test_decay_alone_follows_its_exponential(order):
    """No donor: X_A + X_I = X_m (0.2 + 0.8 exp(-b m_A t)), m_A between its least and largest value (1e-5 apart), and
    the aggregate shrinks with it."""
    made = scene(head="1e-3 cm", donor="0 mg/L", growth={"end": "6 h", "time_step": "1.5 h"}, output={"times": ["6 h"]},
                 numerics=elements(order))
    first, last = run(made)
    pieces = last.pore.space.reaction
    acceptor = last.solved.concentrations.acceptor[pieces.cells] @ pieces.values.T
    bounds = acceptor.min() - 1e-4, acceptor.max() + 1e-4
    most, least = (0.2 + 0.8 * np.exp(-0.12 / 24 * 6 * c / (c + 1)) for c in bounds)
    left = last.pore.mass / first.pore.mass
    assert least <= left <= most and most - least < 1e-5
    assert last.pore.outline.area / first.pore.outline.area == pytest.approx(left, rel=1e-5)
    assert last.pore.inert.sum() / first.pore.mass == pytest.approx((1 - left) / 4, rel=1e-6)


def test_contact_closes_the_film_and_the_run_goes_on(touching):
    """Nodes of contact lie on the walls to the last bit, middles with their corners; one of them is fixed at the top;
    flow is forced through the plug. That ledgers close and the fluid splits is the case coupling-contact."""
    made, found = touching
    states = [instant.pore.contact for instant in found]
    assert states == sorted(states) and not states[0] and sum(states) >= 2
    for instant in found[states.index(True):]:
        outline = instant.pore.outline
        top = outline.wall == TOP
        assert (outline.points[top, 1] == 20.0).all()
        assert (outline.points[outline.wall == BOTTOM, 1] == 0.0).all()
        assert outline.thickness == pytest.approx(20.0, rel=1e-15 if outline.geometry == 1 else 1e-14)
        assert outline.fixed[top].sum() == 1 and not instant.pore.mesh.turned_over().any()
        assert instant.solved.concentrations.acceptor.min() > 0
        if made.numerics.time == "updates":
            assert instant.solved.flow.conductivity < 0.5 * found[0].solved.flow.conductivity
        if outline.geometry == 2:
            middles = np.flatnonzero(top[1::2]) * 2 + 1
            assert not outline.fixed[1::2].any()
            assert (top[middles - 1] & top[(middles + 1) % len(top)]).all()
    assert found[states.index(True)].remeshes >= 1


@EVERY_ORDER
def test_the_fixed_point_is_kept_or_chosen_anew(order):
    """Of an aggregate whose fixed point is beside the middle: "kept" it keeps its x to the last bit, "rechosen" the
    middle does [E20]."""
    made = scene("10 um", velocity="2.9 m/day", growth={"end": "1 h"}, numerics=elements(order))
    now = pore.seeded(made)
    x, middle = now.outline.points[:, 0], int(np.flatnonzero(now.fixed)[0])
    aside = middle + 2 * now.mesh.geometry
    beside = replace(now, fixed=np.arange(len(x)) == aside)
    for word, stays, goes in (("kept", aside, middle), ("rechosen", middle, aside)):
        said = replace(made, numerics=replace(made.numerics, fixed_point=word))
        found = contact.expand(said, beside, 1.2 * now.theta).pore
        assert np.flatnonzero(found.fixed).tolist() == [stays]
        after = found.outline.points[:, 0]
        assert after[stays] == x[stays] and abs(after[goes] - x[goes]) > 0.05
