"""Growth against quadratic elements of scikit-fem (reference/quadratic_growth.py), and against manufactured growth.

Both codes are refined, and fields are compared over the whole body. The uneven cases have no closed form. The reference
takes mu_L = 0.01 MPa, and the package takes no mu_L: without traction it drops out of the positions and scales the
pressure.

The manufactured growth has finite strain, uneven theta, shear and pressure, and the loads that balance it. On random
meshes of a square, three sides are prescribed, and the traction of the fourth determines the level of the pressure. If
the exact pressure has a slope on the rim, its order is that of the layer there (see
:mod:`verification.cases.growth`). Otherwise h_tau, which jumps from triangle to triangle, limits it: with one h for all
triangles the order is two (measured: 1.9 and 2.0 between 0.1 and 0.025), and with their own h it falls from two towards
3/2.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from reference import manufactured_growth, quadratic_growth
from reference.quadratic_growth import Contact
from verification.cases import growth as growth_cases
from verification.evidence.cases import parametrize
from verification.evidence.checks import Check, around, at_most, between, refine, studies
from verification.problems import bodies, meshes

#: Refinements of the package, by geometry, and rings of the reference on each level. 90 and 135 degrees have a node on
#: all levels. Curved triangles are compared with the last level alone.
REFINEMENTS, RINGS = {1: (0.75, 1.35, 2.4, 4.05), 2: (0.3, 0.5, 0.8, 1.3)}, (4, 7, 12, 20)
MODULUS = 0.01
FRONT = 36.0
CONTRAST = 10.0
#: Contact with an upper wall (um), and the number of refinements of the reference towards its ends.
CONTACT, TOWARDS = Contact(np.pi / 2, 3 * np.pi / 4, 65.0), 3
#: Ends of the contact at t = 0, x + i y in um.
ENDS = bodies.RADIUS * np.exp([[1j * CONTACT.first], [1j * CONTACT.last]])
PLACE = "the lower of the two orders: linear elements, second order (quadratic ones: third)"
PRESSURE = ("the lower of the two orders: between 2, linear elements, and 3/2, a layer at the rim where the "
            "stabilisation imposes dP/dn = 0 (the reference: second)")
SINGULAR = "no order: the stress is singular, if weakly, like r^(-1/2) at the ends of the contact; under 1 %"


def _uneven(x, y):
    """theta: 36 at the front, x = -R_0, a tenth of it at the rear, and above half as much again as on the wall."""
    along = CONTRAST ** (-0.5 * (x / bodies.RADIUS + 1))
    return FRONT * along * (1 + 0.5 * (y / bodies.RADIUS) ** 2)


#: theta(X, Y), its largest value, and the contact with an upper wall, if any.
PROBLEMS = {"half-cylinder": (growth_cases.exact(2000.0).theta, 2000.0, None), "uneven": (_uneven, FRONT, None),
            "between walls": (_uneven, FRONT, CONTACT)}


@cache
def reference_solution(name: str, level: int) -> quadratic_growth.Equilibrium:
    """The reference on one level. It starts from the level before."""
    theta, top, contact = PROBLEMS[name]
    ends = (contact.first, contact.last) if contact else ()
    mesh = quadratic_growth.half_disc(bodies.RADIUS, RINGS[level], ends, TOWARDS if ends else 0)
    start = reference_solution(name, level - 1) if level else None
    return quadratic_growth.grow(mesh, theta, top, MODULUS, contact, start)


@cache
def package_solution(name: str, level: int, kind: int):
    """(body, equilibrium) of the package."""
    (theta, _, contact), (body, rim) = PROBLEMS[name], bodies.half_disc(REFINEMENTS[kind][level], kind)
    move, constrained = np.zeros_like(body.reference), body.constrained.copy()
    if contact:
        x, y = body.reference[rim].T
        angle = np.arctan2(y, x)
        in_contact = rim[(angle > contact.first - 1e-9) & (angle < contact.last + 1e-9)]
        constrained[in_contact, 1] = True
        move[in_contact, 1] = contact.height - body.reference[in_contact, 1]
    body = replace(body, constrained=constrained)
    return body, bodies.grow(body, body.field(theta), lambda part: body.reference + part * move)


def gaps(level: int, name: str, kind: int) -> dict[str, float]:
    """Element size, and relative L2 differences of the two codes on a level, over the body at t = 0.

    The pressure has a second difference, away from the ends of the contact.
    """
    reference = reference_solution(name, level if kind == 1 else len(RINGS) - 1)
    body, solution = package_solution(name, level, kind)

    def exact(x, y):
        place, pressure = reference.at(x, y)
        return place, pressure / MODULUS

    middles = body.reference[body.cells[:, :3]].mean(axis=1) @ [1, 1j]
    is_away = np.abs(middles - ENDS).min(axis=0) > 0.2 * bodies.RADIUS
    return {**bodies.errors(body, solution, exact),
            "pressure away": bodies.errors(body, solution, exact, is_away)["pressure"]}


def _reference_change(name: str, difference: float) -> Check:
    """Check that the reference is fine enough: its last change is small against the difference."""
    where, weight = _points()
    before, last = (reference_solution(name, level).at(*where)[0] for level in (len(RINGS) - 2, len(RINGS) - 1))
    return at_most("last change of the reference's positions, over its last difference from the package",
                   meshes.relative(before, last, weight) / difference, 0.3,
                   "the reference must be the finer one; its changes decrease from level to level")


def _points():
    """Quadrature points X, Y (2, t, q) of a mesh of the package, and their weights (t, q)."""
    body, _ = bodies.half_disc(REFINEMENTS[1][2])
    where, weight, _ = bodies.norm_points(body)
    return np.moveaxis(where, 2, 0), weight


def _curved(differences: dict, pressure: str, ceilings: tuple[float, float]):
    """Checks of curved triangles against the last level of the reference.

    They cover the last differences and, without contact, the orders over all refinements. Orders between two meshes of
    few triangles scatter.
    """
    decrease = {name: np.log(values[0] / values[-1]) for name, values in differences.items()}
    for field, order, ceiling in zip(("place", pressure), (3, 2), ceilings):
        if pressure == "pressure":
            yield between(f"order of the {field}", decrease[field] / decrease["size"], *around(order, 0.5),
                          "quadratic positions, linear pressure: third and second order")
        yield at_most(field, differences[field][-1], ceiling, "the reference's elements are finer")


NORM = "L2 over the body at t = 0 of the difference to the reference on the same level, relative: positions; pressure"


def compared(kind: int, problem: str, ceilings: dict[int, tuple[float, float]], pressure: str = "pressure"):
    """Checks of the differences of the two codes with one kind of triangles.

    ceilings: bounds of the last differences of positions and pressure, by kind; pressure: name of the pressure
    difference that has an order.
    """
    differences = refine(gaps, range(len(RINGS)), problem, kind)
    if kind > 1:
        yield _curved(differences, pressure, ceilings[2])
    else:
        place, last = ceilings[1]
        yield studies(differences, {"place": (2, PLACE, place), pressure: (1.75, PRESSURE, last)})
        yield _reference_change(problem, differences["place"][-1])
    if pressure != "pressure":
        yield at_most("pressure, with the ends of the contact", differences["pressure"][-1], 1e-2, SINGULAR)


@pytest.mark.slow
@pytest.mark.case(
    "growth-quadratic-cylinder", kind="cross-code", norm=f"{NORM}; the same of the reference to the closed form",
    mutants=("stabilisation-power", "stabilisation-of-rest"), references=("quadratic_growth",))
@parametrize("kind", bodies.EVERY)
def test_quadratic_cylinder(kind, record):
    """The half-cylinder that has grown to theta = 2000 agrees with quadratic elements of scikit-fem, on straight and on
    curved triangles. These elements have the orders 3 and 2 against the closed form.
    """
    record(compared(kind, "half-cylinder", {1: (6e-4, 6e-3), 2: (6e-5, 6e-3)}))
    if kind == 1:
        rows = {"places": (3, "quadratic elements", 5e-6), "pressure": (2, "linear elements", 1.2e-3)}
        record(studies(refine(_reference_errors, range(len(RINGS))), rows, " of the reference"))


def _reference_errors(level: int) -> dict[str, float]:
    """Size of the reference's elements, and its errors to the closed form."""
    where, weight = _points()
    place, pressure = reference_solution("half-cylinder", level).at(*where)
    exact, exact_pressure = growth_cases.exact(2000.0).at(*where)
    return {"size": bodies.RADIUS / RINGS[level], "places": meshes.relative(place, exact, weight),
            "pressure": meshes.relative(pressure / MODULUS, exact_pressure, weight)}


@pytest.mark.slow
@pytest.mark.case(
    "growth-uneven", kind="cross-code", norm=NORM, mutants=("theta-power", "third-power", "stabilisation-sign"),
    references=("quadratic_growth",))
@parametrize("kind", bodies.EVERY)
def test_uneven(kind, record):
    """A half-disc that grows ten times as much at the front as at the rear, and more above than on the wall, agrees
    with quadratic elements, whatever mu_L is, on straight and on curved triangles.
    """
    record(compared(kind, "uneven", {1: (6e-4, 6e-3), 2: (2e-5, 2.5e-3)}))


@pytest.mark.slow
@pytest.mark.case(
    "growth-between-walls", kind="cross-code",
    norm=f"{NORM}, also further than a fifth of the radius from the ends of the contact",
    mutants=("held-short", "theta-power"), references=("quadratic_growth",))
@parametrize("kind", bodies.EVERY)
def test_between_walls(kind, record):
    """The same half-disc, with a part of its arc on the upper wall, along which it slides, agrees with quadratic
    elements.
    """
    record(compared(kind, "between walls", {1: (1e-3, 6e-3), 2: (1e-3, 6e-3)}, "pressure away"))


#: Element sizes of straight and of curved triangles, with the number of random meshes of each.
SIZES = {1: dict.fromkeys((0.2, 0.1, 0.05, 0.025), 3), 2: dict.fromkeys((0.2, 0.1, 0.05, 0.03), 6)}
LAYER = "3/2 from a layer of one element at the rim, where the stabilisation imposes dP/dn = 0"
UNEVEN = "no layer where dP/dn = 0: between 2, linear elements, and 3/2, for an h that jumps between triangles"
TAYLOR_HOOD = "quadratic positions: third order; linear pressure: second"
#: Orders of the pressure, by kind, and why.
ORDERS = {1: {"sloping": (1.5, LAYER), "flat on the rim": (1.75, UNEVEN)},
          2: {"sloping": (2, TAYLOR_HOOD), "flat on the rim": (2, TAYLOR_HOOD)}}
#: Order of positions and its origin, by kind; last errors of positions and pressure.
PLACES = {1: (2, "linear elements: second order"),
          2: (around(3, 0.45), TAYLOR_HOOD)}  # the coarsest square has five elements a side
CEILINGS = {1: (6e-4, 2e-2), 2: (3e-6, 4e-3)}


def _errors(size: float, seed: int, kind: int, exact) -> dict[str, float]:
    """Relative L2 errors on a random mesh of the unit square, whose side X = 1 is pulled.

    Newton's method starts from the exact positions without pressure.
    """
    grid, side = bodies.rectangle(size, round(1 / size) + seed, kind, 1.0, 1.0, bent=0.0)
    constrained = side["left"] | side["bottom"] | side["top"]
    body = bodies.on_mesh(grid, constrained, constrained)
    forces = bodies.body_force(body, exact.force) + bodies.traction(body, grid, exact.stress)
    solution = bodies.equilibrium(body, body.field(exact.theta), exact.place(*grid.points.T), forces)
    return bodies.errors(body, solution, lambda x, y: (exact.place(x, y), exact.pressure(x, y)))


@pytest.mark.slow
@pytest.mark.case(
    "growth-manufactured", kind="manufactured", mutants=("theta-power", "third-power", "stabilisation-sign"),
    references=("manufactured_growth",))
@parametrize("kind", bodies.EVERY)
def test_manufactured(kind, record):
    """A manufactured growth with theta from 1 to 6.5, shears to one and an uneven pressure, in equilibrium with body
    force and traction, converges with its order, with or without a slope of the pressure on the rim, on straight and on
    curved triangles.

    Norm: L2 of positions and pressure over the body at t = 0, relative, root mean square over three or four random
    meshes a size.
    """
    for name, (order, why) in ORDERS[kind].items():
        exact = manufactured_growth.growth(name)
        place, pressure = CEILINGS[kind]
        record(studies(refine(_errors, SIZES[kind], kind, exact),
                       {"place": (*PLACES[kind], place), "pressure": (order, why, pressure)}, f", {name}"))
