"""Which nodes must close a film or a wedge of fluid (2.3.3), of straight edges and of arcs."""
import numpy as np
import pytest
from hypothesis import given

from repro.fem.outline import BOTTOM, FREE, TOP, Outline
from repro.model import contact
from tests.strategies import attached_aggregates, mirrored, plug

FILM, ANGLE = 2.0, np.radians(16.7)


def beside_contact(along, gap, then=(30.0, 20.0), width=100.0):
    """Lower contact from x = -40 to 10 um; the next node is ``gap`` over the wall, ``along`` beyond the contact
    line."""
    points = np.array([[-40.0, 0.0], [0.0, 0.0], [10.0, 0.0], [10.0 + along, gap], then, (-30.0, 30.0)])
    wall = np.array([BOTTOM] * 3 + [FREE] * 3)
    return Outline(points, wall, np.arange(6) == 1, points.copy())


def beside_upper_contact(gap):
    """A plug of 20 um; 2 um downstream of its upper contact line the next node is ``gap`` under the wall."""
    outline = plug(100.0, -10.0, 10.0)
    points = np.insert(outline.points, 3, [[12.0, 100.0 - gap]], axis=0)
    return Outline(points, np.insert(outline.wall, 3, FREE), np.insert(outline.fixed, 3, False), points)


def joins(outline, width=100.0):
    return contact.closing_nodes(outline, width, FILM, ANGLE).tolist()


NONE = [FREE] * 6


@pytest.mark.parametrize("name, outline, wanted", [
    ("a wedge of 11 degrees closes", beside_contact(1.0, 0.2), [0, 0, 0, BOTTOM, 0, 0]),
    ("a wedge of 16.6 degrees closes", beside_contact(1.0, np.tan(np.radians(16.6))), [0, 0, 0, BOTTOM, 0, 0]),
    ("a wedge of 16.8 degrees stays", beside_contact(1.0, np.tan(np.radians(16.8))), NONE),
    ("a gap over 2 um stays whatever its angle", beside_contact(10.0, 2.1), NONE),
    ("a thin gap far from contact closes", beside_contact(10.0, 1.9), [0, 0, 0, BOTTOM, 0, 0]),
    ("a node through the wall closes", beside_contact(1.0, -0.01), [0, 0, 0, BOTTOM, 0, 0]),
    ("so does one that leans back over the contact", beside_contact(-1.0, -0.01), [0, 0, 0, BOTTOM, 0, 0]),
    ("a steep side stays", beside_contact(-1.0, 0.5), NONE),
    ("no fluid is trapped behind a closing node", beside_contact(1.0, 3.0, (18.0, 1.5)), [0, 0, 0, BOTTOM, BOTTOM, 0]),
    ("a film of 2.01 um to the opposite wall stays", beside_contact(5.0, 30.0, (0.0, 97.99)), NONE),
    ("a film of 1.99 um closes", beside_contact(5.0, 30.0, (0.0, 98.01)), [0, 0, 0, 0, TOP, 0]),
    ("a node through the opposite wall closes", beside_contact(5.0, 30.0, (0.0, 100.5)), [0, 0, 0, 0, TOP, 0]),
    ("a wedge under the upper wall closes", beside_upper_contact(0.2), [0, 0, 0, TOP, 0, 0, 0]),
    ("a wide one stays, though a film of 1.2 um", beside_upper_contact(1.2), [FREE] * 7),
])
def test_what_closes_beside_a_contact_surface(name, outline, wanted):
    """Minimum angle 16.7 degrees, minimum film 2 um (Table 1)."""
    assert joins(outline) == wanted
    assert joins(mirrored(outline)) == wanted[::-1]


@given(attached_aggregates(thickest=1.02) | attached_aggregates(thickest=1.02, geometry=2))
def test_closing_is_the_same_in_a_mirror(drawn):
    """Nothing that is on a wall joins again; of straight edges under the upper wall all that is nearer than the film
    does; of arcs, middles join with both corners on one wall."""
    outline, width = drawn
    found, image = (contact.closing(each, width, FILM, ANGLE) for each in (outline, mirrored(outline)))
    assert image.tolist() == np.roll(found[::-1], 1 - outline.geometry).tolist()
    assert ((found == FREE) | (outline.wall == FREE)).all()
    if outline.geometry == 1:
        over = (outline.wall == FREE) & (width - outline.points[:, 1] < FILM)
        assert ((found == TOP) == over).all()
    else:
        wall = np.where(found == FREE, outline.wall, found)
        middles = np.flatnonzero(wall[1::2] != FREE) * 2 + 1
        assert (wall[middles - 1] == wall[middles]).all() and (wall[(middles + 1) % len(wall)] == wall[middles]).all()


def flat_top(heights, width=20.0):
    """A block whose upper side has nodes at the given heights, corner and middle in turn."""
    count = len(heights)
    x = np.linspace(10.0, -10.0, count)
    top = np.column_stack([x, heights])
    left, right = np.array([[-10.0, 0.5 * heights[-1]]]), np.array([[10.0, 0.5 * heights[0]]])
    base = np.column_stack([np.linspace(-10, 10, 5), np.zeros(5)])
    points = np.vstack([base, right, top, left])
    wall = np.where(np.arange(len(points)) < 5, BOTTOM, FREE)
    return Outline(points, wall, np.arange(len(points)) == 2, points.copy(), 2), 6 + np.arange(count)


def test_contact_begins_to_both_sides_of_the_highest_place():
    """Over the film's least thickness, 2.5 um, though the highest corner alone is too near: nodes are 1 um apart."""
    x = np.linspace(10.0, -10.0, 21)
    shape, top = flat_top(17.52 - 0.05 * x**2)
    joins = contact.closing(shape, 20.0, 2.5, 0.0)
    assert np.array_equal(np.flatnonzero(joins == TOP), top[8:13])


def test_a_middle_never_joins_alone():
    """An arc of which only the middle is too near brings its nearer corner; a middle joins with both corners."""
    shape, top = flat_top([12.0, 16.0, 17.0, 18.5, 17.5, 16.0, 12.0])
    joins = contact.closing(shape, 20.0, 2.0, 0.0)
    assert np.array_equal(np.flatnonzero(joins == TOP), [top[4]]), "the corner beside it at 17.5, not that at 17"
    shape, top = flat_top([12.0, 16.0, 18.5, 18.9, 18.6, 16.0, 12.0])
    joins = contact.closing(shape, 20.0, 2.0, 0.0)
    assert np.array_equal(np.flatnonzero(joins == TOP), top[2:5]), "both corners, and the middle with them"
    shape, _ = flat_top([12.0, 16.0, 17.0, 17.5, 17.0, 16.0, 12.0])
    assert not contact.closing(shape, 20.0, 2.0, 0.0).any()
