"""Coupled runs with elements of every order: decay, contact, options.

Ledgers, symmetry, growth in closed form and orders in time are cases of the stage coupling.
"""
from dataclasses import replace

import numpy as np
import pytest

from repro.fem.outline import BOTTOM, TOP
from repro.march.simulation import simulate
from repro.model import contact
from repro.model.pore import seeded
from tests import strategies
from tests.strategies import EVERY_ORDER, ORDERS


def elements(order):
    """The paper's scheme with elements of an order; higher orders have fewer elements."""
    return {"elements": ORDERS[order], "refinement": {1: 1.0, 2: 0.4, 3: 0.3}[order]}


def run(scene):
    """Return all instants of a scene's run."""
    return list(simulate(scene))


#: (scheme, order of elements); the midpoint rule has elements as large as those of preset fast.
WAYS = [("updates", 1), ("updates", 2), ("midpoint", 1), ("midpoint", 2)]


@pytest.fixture(scope="module", params=WAYS, ids=lambda way: f"{way[0]}-{way[1]}")
def touching(request):
    """Scene and instants of an aggregate that is 0.1 um short of contact, under a constant velocity."""
    time, order = request.param
    numerics = elements(order)
    if time == "midpoint":
        numerics |= {"preset": "fast", "refinement": 0.5 if order == 1 else 0.2}
    radius, growth = "17.9 um", {"end": "1 h"}
    if (time, order) == ("midpoint", 1):  # a film of 2 um would thin out the straight triangles beside it
        radius, growth = "18.9 um", {"end": "1 h", "minimum_film": "1 um"}
    scene = strategies.scene(radius, "20 um", velocity="2.9 m/day", growth=growth, numerics=numerics)
    return scene, [instant for instant in run(scene) if instant.ledgers or instant.pore.time == 0]


def test_contact_closes_the_film_and_the_run_continues(touching):
    """Nodes in contact lie on the walls to the last bit, mid-edge nodes with their corners. One upper node is fixed.
    The flow passes the plug. The case coupling-contact covers ledgers and the split fluid."""
    scene, instants = touching
    states = [instant.pore.contact for instant in instants]
    assert states == sorted(states) and not states[0] and sum(states) >= 2
    for instant in instants[states.index(True):]:
        outline = instant.pore.outline
        top = outline.wall == TOP
        assert (outline.points[top, 1] == 20.0).all()
        assert (outline.points[outline.wall == BOTTOM, 1] == 0.0).all()
        assert outline.thickness == pytest.approx(20.0, rel=1e-15 if outline.geometry == 1 else 1e-14)
        assert outline.fixed[top].sum() == 1 and not instant.pore.mesh.turned_over().any()
        assert instant.solved.concentrations.acceptor.min() > 0
        if scene.numerics.time == "updates":
            assert instant.solved.flow.conductivity < 0.5 * instants[0].solved.flow.conductivity
        if outline.geometry == 2:
            middles = np.flatnonzero(top[1::2]) * 2 + 1
            assert not outline.fixed[1::2].any()
            assert (top[middles - 1] & top[(middles + 1) % len(top)]).all()
    assert instants[states.index(True)].remeshes >= 1


@EVERY_ORDER
def test_the_fixed_point_is_kept_or_rechosen(order):
    """The fixed point starts beside the middle. With "kept" it keeps its x to the last bit, with "rechosen" the middle
    does [E20]."""
    scene = strategies.scene("10 um", velocity="2.9 m/day", growth={"end": "1 h"}, numerics=elements(order))
    pore = seeded(scene)
    x, middle = pore.outline.points[:, 0], int(np.flatnonzero(pore.fixed)[0])
    aside = middle + 2 * pore.mesh.geometry
    shifted = replace(pore, fixed=np.arange(len(x)) == aside)
    for option, stays, goes in (("kept", aside, middle), ("rechosen", middle, aside)):
        variant = replace(scene, numerics=replace(scene.numerics, fixed_point=option))
        expanded = contact.expand(contact.Mechanics.of(variant), shifted, 1.2 * pore.theta).pore
        assert np.flatnonzero(expanded.fixed).tolist() == [stays]
        after = expanded.outline.points[:, 0]
        assert after[stays] == x[stays] and abs(after[goes] - x[goes]) > 0.05
