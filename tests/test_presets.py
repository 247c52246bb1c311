"""Runs of the presets and of every order of the elements, and what scenes say of both."""
from dataclasses import replace

import numpy as np
import pytest

from repro.fem import sizing
from repro.fem.outline import TOP
from repro.march import midpoint, simulation
from repro.model import pore, remeshing
from repro.model.biomass import Rates
from repro.model.kinetics import growth_rate, inert_rate
from repro.model.pore import Solved
from repro.model.transport import Concentrations
from repro.scene import PRESETS, Numerics, load_scene, parse_scene
from repro.scene.rules import HIGHER_ORDER
from repro.scene.units import SceneError
from tests.strategies import ORDERS, scene
from tests.test_scene import EVERYTHING

EVERY_ORDER = pytest.mark.parametrize("order", ORDERS)


def elements(order):
    """Those of an order, of the size of preset fast."""
    return {"preset": "fast", "elements": ORDERS[order], "refinement": 0.5 if order == 1 else 0.2}


def base(*changes, order=2):
    sets = [f"numerics.{key}={value}" for key, value in elements(order).items()]
    return load_scene("base", (*sets, *changes))


def run(made):
    """All instants of a scene."""
    return list(simulation.simulate(made))


@pytest.fixture(scope="module", params=ORDERS)
def contact(request):
    """The steps through contact with the opposite wall, with their scene."""
    made = scene("17.9 um", "20 um", velocity="2.9 m/day", growth={"end": "1 h"}, numerics=elements(request.param))
    return made, [instant for instant in run(made) if instant.ledgers or instant.pore.time == 0]


@pytest.mark.parametrize("order, area, radius", [(1, 1e-3, 5e-3), (2, 1e-6, 1e-4), (3, 1e-6, 1e-4)])
def test_growth_in_plenty_is_exponential_and_round(order, area, radius):
    """Diffusion holds the supply: mass by (9)-(10), a half-disc; the area of linear elements to the density's drift at
    remeshes [E7]."""
    made = base('growth.end="6 h"', 'output.times=["6 h"]', order=order)
    fast = {name: replace(getattr(made.substrates, name), diffusivity=1e13, diffusivity_in_aggregate=1e13)
            for name in ("acceptor", "donor")}
    made = replace(made, flow=None, substrates=replace(made.substrates, **fast))
    first, last = run(made)
    rise, left = (rate(*(10.0, 10.0)[:n], made.substrates, made.kinetics) for rate, n in ((growth_rate, 2),
                                                                                            (inert_rate, 1)))
    wanted = first.pore.outline.area * (np.exp(6 * rise) + left / rise * np.expm1(6 * rise))
    assert last.pore.mass == pytest.approx(wanted * made.kinetics.maximum_density, rel=1e-6)
    assert last.pore.outline.area == pytest.approx(wanted, rel=area)
    free = last.pore.outline.wall == 0
    assert np.allclose(np.hypot(*last.pore.outline.points[free].T), np.sqrt(2 * wanted / np.pi), rtol=radius)


def test_the_first_guess_at_a_step_s_end():
    """As much change again as the first half has made; not below zero, nor on another mesh."""
    start, half, other = (Concentrations(np.array(a), np.array(b)) for a, b in (
        ([3.0, 2.0], [5.0, 4.0]), ([2.5, 1.5], [5.0, 3.5]), ([1.0], [1.0])))
    spent = replace(half, acceptor=np.array([2.5, 0.5]))
    start, half, other, spent = (Solved(None, None, state) for state in (start, half, other, spent))
    guess = midpoint._extrapolated(start, half, 1.0)
    assert np.array_equal(guess.acceptor, [2.0, 1.0]) and np.array_equal(guess.donor, [5.0, 3.0])
    assert np.array_equal(midpoint._extrapolated(start, half, 0.25).acceptor, [2.75, 1.75])
    assert midpoint._extrapolated(start, other, 1.0) is start.concentrations
    assert midpoint._extrapolated(start, spent, 1.0) is spent.concentrations


def test_density_is_kept(contact):
    """J = theta: (X_A + X_I) / X_m is one but for what the linear pressure cannot see, mass over area exactly on curved
    triangles. On straight ones mass follows the area to the drift [E7], and a film that closes squeezes a few of these
    coarse triangles (0.63 of X_m; 0.56 a step later, before there is a new mesh)."""
    made, found = contact
    most, drift = made.kinetics.maximum_density, 2e-2 if made.numerics.order == 1 else 1e-9
    bounds = (0.5, 1.2) if made.numerics.order == 1 else (0.9, 1.1)
    for instant in found:
        share, least, largest = instant.pore.composition(most)
        assert instant.pore.mass == pytest.approx(most * instant.pore.mesh.area(), rel=drift)
        assert bounds[0] < least <= largest < bounds[1]
    shares = [instant.pore.composition(1.0)[0] for instant in found]
    assert (np.diff(shares) > 0).all() and 0 < shares[-1] < 0.1


@pytest.mark.parametrize("across", [0.0, 8.0])
def test_elements_beside_contact_lines_are_as_small_as_asked(across):
    """The edges beside the upper contact lines of a new mesh, against the least film over their number; without, as
    large as elsewhere."""
    made = scene("17.9 um", "20 um", velocity="2.9 m/day", growth={"end": "0.4 h"},
                 numerics={**elements(2), "contact_elements": across})
    film = made.growth.minimum_film
    last = next(instant.pore for instant in reversed(run(made)) if instant.remeshes)
    outline = last.outline.corners
    top = outline.wall == TOP
    beside = np.flatnonzero(outline.interface_edges() & (top | np.roll(top, -1)))
    assert len(beside) == 2
    sizes = outline.edge_lengths()[beside]
    assert (sizes <= sizing.SPLIT * 1.35 * (film / 8 + sizing.GRADATION * sizes)).all() == (across == 8)


def test_contact_is_made_and_kept(contact):
    """Nodes and arcs on the upper wall lie on it, middles with their corners; one node there is fixed; the surface
    grows."""
    made, found = contact
    after = [instant.pore for instant in found if instant.pore.contact]
    assert 2 <= len(after) < len(found)
    for now in after:
        shape = now.outline
        top = shape.wall == TOP
        assert (shape.points[top, 1] == made.pore.width).all()
        assert shape.thickness == pytest.approx(made.pore.width, rel=1e-14)
        assert shape.fixed[top].sum() == 1 and not now.mesh.turned_over().any()
        if shape.geometry == 2:
            middles = np.flatnonzero(top[1::2]) * 2 + 1
            assert not shape.fixed[1::2].any()
            assert (top[middles - 1] & top[(middles + 1) % len(top)]).all()
    widths = [np.ptp(now.outline.points[now.outline.wall == TOP, 0]) for now in after]
    assert (np.diff(widths) >= -1e-9).all() and widths[-1] > 5


@EVERY_ORDER
def test_without_flow_both_sides_are_alike(order):
    """To what an unsymmetric mesh makes of it."""
    *_, last = run(replace(base('growth.end="8 h"', 'output.times=["8 h"]', order=order), flow=None))
    shape = last.pore.outline
    assert abs(shape.downstream + shape.upstream) < 2e-4 * shape.downstream
    assert shape.area > 100


@EVERY_ORDER
def test_it_is_the_paper_s_aggregate(order):
    """Both schemes at 4 h, within the paper's own error of 1 %."""
    ends = ('growth.end="4 h"', 'output.times=["4 h"]')
    ours, theirs = run(base(*ends, order=order))[-1], run(load_scene("base", ('numerics.preset="paper"', *ends)))[-1]
    for name in ("area", "upstream", "thickness"):
        assert getattr(ours.pore.outline, name) == pytest.approx(getattr(theirs.pore.outline, name), rel=1e-2)
    assert ours.solved.flow.conductivity == pytest.approx(theirs.solved.flow.conductivity, rel=2e-2)


def places_of(space):
    """(r, q, 2) um of the points of the reaction."""
    if space.order == 1:
        return space.mesh.points[space.reaction.cells]
    return space.mesh.points[space.mesh.cells[space.mesh.biomass]].transpose(0, 2, 1) @ space.table.shape.T


def carried_back(order, straight):
    """Largest errors of rates that are linear in the place, and one everywhere, carried back from a new mesh to the
    material's points; straight: of triangles whose edges are."""
    made = base('aggregate.radius="20 um"', order=order)
    now = pore.seeded(made)
    points = now.mesh.with_middles(now.mesh.points[: now.mesh.corners]) if straight else now.mesh.points
    half = now.moved(points * [1.1, 1.1])
    there, _ = remeshing.remesh(made, now, half, 0.0)
    x, y = np.moveaxis(places_of(there.space), 1 if order > 1 else 2, 0)
    back = midpoint._carried_back(there, half, Rates(2 * x + y, 3 - y))
    ones = midpoint._carried_back(there, half, Rates(0 * x + 1, 0 * x + 2))
    x, y = np.moveaxis(places_of(half.space), 1 if order > 1 else 2, 0)
    linear = np.abs(back.growth - 2 * x - y).max(), np.abs(back.remains - 3 + y).max()
    return max(linear), max(np.abs(ones.growth - 1).max(), np.abs(ones.remains - 2).max())


@EVERY_ORDER
def test_rates_are_carried_back_from_a_new_mesh(order):
    """Rates that are linear in the place half way come back as they are there, exactly where edges are straight; along
    bent ones what is linear within a triangle is not so in the place, to 1 % of the range (measured 0.5 %)."""
    linear, even = carried_back(order, straight=True)
    assert linear < 1e-6 and even < 1e-12
    linear, even = carried_back(order, straight=False)
    assert linear < (1e-6 if order == 1 else 0.01 * 88) and even < 1e-12


def numerics(**given):
    return parse_scene(EVERYTHING | {"numerics": given}, "test", "test.toml").numerics


@pytest.mark.parametrize("preset", PRESETS)
def test_a_preset_changes_the_defaults(preset):
    """All that it names, nothing else."""
    assert numerics(preset=preset) == replace(Numerics(), preset=preset, **PRESETS[preset])


def test_presets_say_what_they_are():
    """The paper's is the paper's scheme; the others are curved, second in time, the accurate one finer, the exact one
    finer still."""
    paper, fast, accurate = (numerics(preset=name) for name in ("paper", "fast", "accurate"))
    assert (paper.elements, paper.time, paper.refinement) == ("linear", "updates", 1.0)
    assert fast.elements == accurate.elements == "quadratic" and fast.time == accurate.time == "midpoint"
    assert fast.refinement < accurate.refinement and fast.tolerance > accurate.tolerance
    exact = numerics(preset="exact")
    assert (exact.elements, exact.time) == ("quadratic", "midpoint") and exact.refinement > accurate.refinement
    assert 3 * exact.tolerance < accurate.tolerance
    assert [numerics(preset=name).contact_elements for name in PRESETS] == [0, 0, 2, 0]


def test_what_is_written_wins_over_the_preset():
    found = numerics(preset="fast", refinement=0.8, elements="linear", time="updates")
    assert (found.refinement, found.elements, found.time, found.tolerance) == (0.8, "linear", "updates", 0.0075)


@pytest.mark.parametrize("kind", ["quadratic", "cubic"])
@pytest.mark.parametrize("key, other", [("transfer", "linear"), ("transfer", "bounded"), ("flow_element", "bubble")])
def test_what_higher_orders_cannot_do_is_refused(kind, key, other):
    """In one line, by the key's name, with what there is."""
    assert key in HIGHER_ORDER
    wanted = rf'numerics.{key}.*"{HIGHER_ORDER[key]}" is needed with numerics.elements = "{kind}"; "linear" has'
    with pytest.raises(SceneError, match=wanted) as refused:
        numerics(preset="paper", elements=kind, **{key: other})
    assert "\n" not in str(refused.value)
    assert getattr(numerics(preset="paper", elements="linear", **{key: other}), key) == other
