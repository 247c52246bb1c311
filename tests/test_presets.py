"""What presets stand for, and what the midpoint rule does with elements of every order."""
from dataclasses import replace

import numpy as np
import pytest

from repro.fem import sizing
from repro.fem.outline import TOP
from repro.march import midpoint, simulation
from repro.model import pore, remeshing
from repro.model.biomass import Rates
from repro.model.contact import Expansion
from repro.model.pore import Solved
from repro.model.transport import Concentrations
from repro.scene import PRESETS, Numerics, load_scene, parse_scene
from tests.strategies import ORDERS, scene
from tests.test_scene import EVERYTHING
from verification.problems.aggregates import places


def elements(order):
    """Those of an order, of the size of preset fast."""
    return {"preset": "fast", "elements": ORDERS[order], "refinement": 0.5 if order == 1 else 0.2}


def base(*changes, order=2):
    sets = [f"numerics.{key}={value}" for key, value in elements(order).items()]
    return load_scene("base", (*sets, *changes))


def solved(acceptor, donor):
    """What is solved of these concentrations alone."""
    return Solved(None, None, Concentrations(np.array(acceptor), np.array(donor)))


def test_the_first_guess_at_a_step_s_end():
    """As much change again as the first half has made; not below zero, nor on another mesh."""
    start, half = solved([3.0, 2.0], [5.0, 4.0]), solved([2.5, 1.5], [5.0, 3.5])
    for part, acceptor, donor in ((1.0, [2.0, 1.0], [5.0, 3.0]), (0.25, [2.75, 1.75], [5.0, 3.75])):
        guess = midpoint._extrapolated(start, half, part)
        assert guess.acceptor.tolist() == acceptor and guess.donor.tolist() == donor
    other, spent = solved([1.0], [1.0]), solved([2.5, 0.5], [5.0, 3.5])
    assert midpoint._extrapolated(start, other, 1.0) is start.concentrations
    assert midpoint._extrapolated(start, spent, 1.0) is spent.concentrations


@pytest.mark.parametrize("across", [0.0, 8.0])
def test_elements_beside_contact_lines_are_as_small_as_asked(across):
    """The edges beside the upper contact lines of a new mesh, against the least film over their number; without, as
    large as elsewhere."""
    made = scene("17.9 um", "20 um", velocity="2.9 m/day", growth={"end": "0.4 h"},
                 numerics={**elements(2), "contact_elements": across})
    film = made.growth.minimum_film
    last = next(instant.pore for instant in reversed(list(simulation.simulate(made))) if instant.remeshes)
    outline = last.outline.corners
    top = outline.wall == TOP
    beside = np.flatnonzero(outline.interface_edges() & (top | np.roll(top, -1)))
    assert len(beside) == 2
    sizes = outline.edge_lengths()[beside]
    assert (sizes <= sizing.SPLIT * 1.35 * (film / 8 + sizing.GRADATION * sizes)).all() == (across == 8)


@pytest.mark.parametrize("straight", [True, False])
@pytest.mark.parametrize("order", ORDERS)
def test_rates_are_carried_back_from_a_new_mesh(order, straight):
    """Rates that are linear in the place half way come back to the material's points as they are there, exactly where
    edges are straight; along bent ones what is linear within a triangle is not so in the place, to 1 % of the range
    (measured 0.5 %). Those that are one everywhere stay so."""
    made = base('aggregate.radius="20 um"', order=order)
    now = pore.seeded(made)
    points = now.mesh.with_middles(now.mesh.points[: now.mesh.corners]) if straight else now.mesh.points
    half = now.moved(points * [1.1, 1.1])
    there, _ = remeshing.remesh(made, now, half, 0.0)
    (x, y), (u, v) = places(there.space), places(half.space)
    accepted = 1e-6 if straight or order == 1 else 0.01 * 88
    for given, wanted, bound in ((Rates(2 * x + y, 3 - y), (2 * u + v, 3 - v), accepted),
                                 (Rates(0 * x + 1, 0 * x + 2), (1, 2), 1e-12)):
        back = midpoint._carried_back(there, now, Expansion(half, 0, 0.0), given)
        assert max(np.abs(back.growth - wanted[0]).max(), np.abs(back.remains - wanted[1]).max()) < bound


def numerics(**given):
    return parse_scene(EVERYTHING | {"numerics": given}, "test", "test.toml").numerics


def test_a_preset_changes_the_defaults():
    """All that it names, nothing else; the extent follows from the flow. The paper's is the paper's scheme."""
    for preset, chosen in PRESETS.items():
        assert numerics(preset=preset) == replace(Numerics(), preset=preset, extent="central", **chosen)
    paper = numerics(preset="paper")
    assert (paper.elements, paper.time, paper.refinement) == ("linear", "updates", 1.0)


def test_what_is_written_wins_over_the_preset():
    found = numerics(preset="fast", refinement=0.8, elements="linear", time="updates")
    assert (found.refinement, found.elements, found.time, found.tolerance) == (0.8, "linear", "updates", 0.0075)
