"""The fixed point of the contact surface, with elements of every order.

Ledgers, symmetry, growth in closed form and orders in time are cases of the stage coupling.
"""
from dataclasses import replace

import numpy as np

from repro.model import contact
from repro.model.pore import seeded
from tests import strategies
from tests.strategies import EVERY_ORDER, ORDERS


def elements(order):
    """The paper's scheme with elements of an order; higher orders have fewer elements."""
    return {"elements": ORDERS[order], "refinement": {1: 1.0, 2: 0.4, 3: 0.3}[order]}


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
