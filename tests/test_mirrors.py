"""Mirror symmetry of rules about ends, reaches, signs and intervals.

The mirror of a pore is x -> -x: areas, numbers and warnings stay the same, the two ends change places. The mirror of a
number is its negative: the ends of its interval change places and signs.
"""

from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from repro import PoreEnd, simulate
from repro.fem import sizing
from repro.fem.walls import BOTTOM, TOP, channel_walls
from repro.march.simulation import shaped
from repro.model import contact
from repro.model.mechanics import Mechanics
from repro.model.meshing import seeded
from repro.preflight import simplifications
from tests.strategies import MIRRORS, in_um, outlines
from tests.test_derived import SHAPE, SPANNING, drawn
from verification import claims, sensitivity
from verification.network import law
from verification.problems.schemes import exchange, load_scene

SIDES = pytest.mark.parametrize("sign, side", [(-1, "upstream"), (1, "downstream")])


@SIDES
@pytest.mark.parametrize("steps", ["updates", "midpoint"])
def test_a_first_step_that_passes_an_end_of_the_pore_ends_there(steps, sign, side):
    """The middle of a seed of 5 um is 5.3 um from the end. `test_ends.py` has ends within later steps."""
    changes = ["numerics.refinement=0.5", "pore.length=200 um", "growth.end=6 h", "growth.time_step=1.5 h",
               exchange(steps=steps), f"aggregate.position={sign * 94.7} um", 'output.times=["6 h"]']
    with pytest.raises(PoreEnd, match=f"^the aggregate reaches the pore's {side} end at t = 0 h"):
        list(simulate(load_scene("base", changes)))


@cache
def seed_of(order, spans):
    """(scene, its pore at t = 0): an asymmetric aggregate between both walls, or one that almost spans the pore."""
    scene = shaped(drawn(order), SPANNING if spans else SHAPE)
    return scene, seeded(scene)


@cache
def grown(order, spans, image):
    """An aggregate, or its mirror image, after uneven growth that moves all of its contact lines."""
    scene, seed = seed_of(order, spans)
    x, y = seed.mesh.points[seed.mesh.cells[seed.mesh.biomass, :3]].mean(axis=1).T
    growth = 1.5 + 0.01 * x + 0.005 * y if spans else 1.02 + 0.001 * x
    seed = seed.with_body(theta=growth[:, None] * seed.body.theta)
    seed = MIRRORS[image](seed) if image else seed
    return contact.expand(Mechanics.of(scene), seed, [seed.body.theta]).pore


@pytest.mark.parametrize("order, spans, image", [
    pytest.param(order, spans, image,
                 marks=pytest.mark.thorough if image == "along" and (order, spans) != (1, True) else ())
    for order in (1, 2) for spans in (True, False) for image in MIRRORS])
def test_contact_advances_alike_in_a_pore_and_its_mirror_image(order, spans, image):
    """Contact by nodes and by lines, the first contact included: each rule holds on either side and either wall, to the
    defect of Newton's method."""
    expected, computed = MIRRORS[image](grown(order, spans, None)), grown(order, spans, image)
    assert np.array_equal(computed.body.wall, expected.body.wall)
    assert np.array_equal(computed.body.fixed, expected.body.fixed)
    assert computed.boundary.points == pytest.approx(expected.boundary.points, abs=1e-6)
    _, seed = seed_of(order, spans)
    assert expected.contact
    if not spans:
        return
    before, after = (np.array([[x[at.wall == wall].min(), x[at.wall == wall].max()] for wall in (BOTTOM, TOP)])
                     for at in (seed.boundary, grown(order, True, None).boundary) for x in [at.points[:, 0]])
    assert (np.abs(after - before) > 0.1).all(), "each line has moved"


@SIDES
def test_the_reach_of_an_outline_is_reported_on_either_side(sign, side):
    """The farther end counts: 100 um of 130 um."""
    points = np.array([[-20.0, 0.0], [-10.0, 12.0], [60.0, 20.0], [100.0, 0.0]])
    points = points if sign > 0 else points[::-1] * [-1, 1]
    scene = load_scene("base", [f"aggregate.outline={in_um(points)}", "pore.length=260 um", "growth.end=0 h"],
                       unset=["aggregate.radius"])
    warnings = {warning.key: warning.text for warning in simplifications.find_warnings(scene, 1e5)}
    assert "(reach 100 of 130 um)" in warnings.get("pore.length", "")


def mirror_image(outline):
    """The mirror image of a polygon that may begin at any corner."""
    return type(outline)(outline.points[::-1] * [-1, 1], outline.wall[::-1], outline.fixed[::-1],
                         outline.origin[::-1] * [-1, 1])


@given(outlines(), st.sampled_from([np.inf, 0.3]), st.floats(0.05, 2.0))
def test_sizes_at_an_outline_and_its_mirror_image(drawn, contact, refinement):
    """Sizes agree node by node and in the fluid, with and without small elements beside contact lines."""
    outline, width = drawn
    sizes = sizing.Sizing(channel_walls(width), refinement, 2.0, contact=contact)
    one, other = (sizing.interface_sizes(each, sizes) for each in (outline, mirror_image(outline)))
    assert one == pytest.approx(other[::-1], rel=1e-9)
    (sources, one), (mirrored, other) = (sizing.size_sources(each, sizes) for each in (outline, mirror_image(outline)))
    order, exchanged = (np.lexsort(each.T.round(9)) for each in (sources, mirrored * [-1, 1]))
    assert one[order] == pytest.approx(other[exchanged], rel=1e-9)
    assert sizing.too_coarse(outline, sizes) == sizing.too_coarse(mirror_image(outline), sizes)


# Numbers and their negatives.
@given(st.floats(0.01, 50.0), st.sampled_from([*sensitivity.record()["elasticities"]]))
def test_the_interval_of_a_negative_number_is_that_of_its_mirror(value, quantity):
    low, high = sensitivity.interval(quantity, value)
    assert low <= value <= high
    assert sensitivity.interval(quantity, -value) == (-high, -low)


@given(*2 * [st.lists(st.floats(-10.0, 10.0), min_size=2, max_size=2).map(sorted)])
def test_an_outcome_is_that_of_its_mirror(bar, bounds):
    """The outcome follows from an error bar and the accepted bounds."""
    (low, high), (least, most) = bar, bounds
    outcome = claims.outcome_of((low, high), (least, most))
    assert outcome == claims.outcome_of((-high, -low), (-most, -least))
    assert (outcome == claims.HOLDS) == (least <= low and high <= most)
    assert (outcome == claims.FAILS) == (high < least or most < low)


@pytest.mark.parametrize("side", [0, 1])
@pytest.mark.parametrize("part, inside", [(0.99, 1), (1.01, 0)])
@pytest.mark.parametrize("spanned, area", [(0, 0.5), (1, 2.0)])
def test_a_shape_is_judged_by_the_bound_of_the_law_on_its_side(spanned, area, part, inside, side):
    """A shape lies part of the way, in logarithms, from the law to its lower or upper bound."""
    length, *bounds = law.added_resistance(area, 1.0, bool(spanned), 2000.0)
    shape = length * (bounds[side] / length) ** part
    row = dict(zip(law.COLUMNS, np.array([[1], [1], [spanned], [2000.0], [area], [shape]], float)))
    verdict = law.judged(row)
    assert verdict.inside == inside and verdict.beyond == pytest.approx(part, rel=1e-9)
