"""Growth against closed forms, and its law (14)-(24).

Homogeneous growth, free and confined, is exact with linear and quadratic elements on any mesh. Patch tests are exact,
too: if the positions of the rim are prescribed as F X, the body has F inside, with constant pressure. One end is free
along its normal, or pulled. If the whole rim were prescribed, the pressure would be determined only up to a constant.

The half-cylinder that grows by theta(R) has a closed form of shape and pressure, far from t = 0. The stabilisation
imposes dP/dn = 0 on the rim, where the exact pressure has a slope. In one layer of elements the pressure errs by O(h),
which is O(h^(3/2)) in the mean square over the body. The literature agrees: order one is proven (Hughes, Franca and
Balestra, 1986), and 3/2 on nearly regular meshes (Eichel, Tobiska and Xie, 2011).

The law: derivatives, and the stabilisation (27).
"""

from dataclasses import replace

import numpy as np
import pytest

from reference import neo_hookean
from repro.model import growth
from verification.evidence.cases import parametrize
from verification.evidence.checks import Check, Study, around, at_most, each_at_most, largest, refine, studies, study
from verification.problems import bodies
from verification.problems.bodies import Supported

REPRODUCED = "round-off: the elements contain the solution; Newton's method stops at 1e-11"
#: Rows and columns of the components of a stress (3, 3) that the package returns.
COMPONENTS = [0, 1, 2, 0], [0, 1, 2, 1]


def exactly(name: str, body: Supported, solution: growth.Equilibrium, F: np.ndarray, pressure: float) -> list[Check]:
    """Check positions, pressures and Cauchy stresses of an equilibrium against homogeneous F (2, 2) and P."""
    exact = neo_hookean.cauchy(F, pressure)
    P = solution.pressure[body.cells[:, :3]] @ body.shape.table.linear.T
    stress = growth.cauchy(body.strained(solution.position), P)
    scale = max(largest(exact), abs(pressure))
    sizes = {"place": largest(solution.position @ np.linalg.inv(F).T - body.reference) / bodies.LENGTH,
             "pressure": largest(solution.pressure - pressure) / scale,
             "stress": largest(stress - exact[COMPONENTS]) / scale}
    return each_at_most(sizes, 1e-9, REPRODUCED, f", {name}")


NORM = "largest difference: positions, mapped back to t = 0, over the length; pressures and stresses over the largest"
#: Element sizes (um) of each kind, and random displacements (um) of inner nodes.
SIZES, SHAKEN = {1: 1.3, 2: 2.0}, {1: 0.1, 2: 0.02}


def _supported(size: float, kind: int):
    """(name, body, function theta -> F and P) of a free body and of a confined one."""
    grid, side = bodies.rectangle(size, 4, kind)
    for name, support, exact in (("free", side["left"], _free), ("confined", side["left"] | side["right"], _confined)):
        yield name, bodies.on_mesh(grid, support, side["bottom"]), exact


@pytest.mark.case(
    "growth-homogeneous", kind="exact", norm=NORM,
    mutants=("theta-power", "third-power", "thickness-forgotten", "stress-across", "theta-since-the-start"),
    references=("neo_hookean",))
@parametrize("kind", bodies.EVERY)
def test_homogeneous(kind, record):
    """Uniform growth, free to theta = 2000 and confined to one direction to theta = 36, has the exact shape, pressure
    and stress on any mesh of straight or of curved triangles [E11]. The same holds on a mesh that was generated after a
    part of the growth: theta counts from t = 0, whatever shape the search starts from.
    """
    for name, body, exact in _supported(SIZES[kind], kind):
        for theta in (2.0, 36.0, 2000.0):
            if theta < 2000 or name == "free":
                record(exactly(f"{name}, theta = {theta:g}", body, bodies.grow(body, body.constant(theta)),
                               *exact(theta)))
    for name, body, exact in _supported(1.6, kind):
        for top, mesh_theta in ((2.0, 1.0), (36.0, 1.0), (36.0, 5.0)):
            start = body.reference @ exact(mesh_theta)[0]
            solution = bodies.equilibrium(body, body.constant(top), start)
            record(exactly(f"{name}, theta = {top:g}, mesh of {mesh_theta:g}", body, solution, *exact(top))[:2])


def _free(theta: float):
    """F and P."""
    return np.sqrt(theta) * np.eye(2), neo_hookean.free_growth_pressure(theta)


def _confined(theta: float):
    """F and P."""
    return np.diag([1.0, theta]), neo_hookean.confined_growth_pressure(theta)


#: F = [[a, b], [0, d]] by a, b, d: squeezed along x, sheared by 3, half and 2000 times the area.
SHEARS = ((0.7, 0.9, 2.5), (1.0, 3.0, 2.0), (0.8, -0.5, 0.625), (20.0, 60.0, 100.0))
TURN = np.array([[0.0, -1.0], [1.0, 0.0]])


@pytest.mark.case(
    "growth-patch", kind="exact", norm=NORM,
    mutants=("theta-power", "untransposed", "thickness-forgotten", "held-short"), references=("neo_hookean",))
@parametrize("kind", bodies.EVERY)
def test_patch(kind, record):
    """A body of straight or curved triangles has F inside, with constant and exact pressure and stress, if the
    positions of its rim are prescribed as F X and one end is free along its normal: for shears to 3, J from 0.5 to
    2000, and the free end on each of the four sides.
    """
    record([_sheared(kind, np.linalg.matrix_power(TURN, turns), *shear) for turns, shear in enumerate(SHEARS)])


def _turned(body: Supported, change: np.ndarray) -> Supported:
    """The body with its positions and constraints transformed by a matrix (2, 2) with one entry in each row."""
    return replace(body, reference=body.reference @ change.T, constrained=np.abs(body.constrained @ change.T) > 0)


def _sheared(kind: int, Q: np.ndarray, a: float, b: float, d: float) -> list[Check]:
    """Check a sheared body turned by Q, a multiple of a right angle. Its former upper end is free along its normal."""
    grid, side = bodies.rectangle(SIZES[kind], 5, kind)
    rim = side["left"] | side["right"] | side["bottom"]
    body = _turned(bodies.on_mesh(grid, rim | side["top"], rim), Q)

    def F(part):
        return Q @ np.array([[a**part, part * b], [0.0, d**part]]) @ Q.T

    solution = bodies.grow(body, body.constant(a * d), lambda part: body.reference @ F(part).T)
    pressure = -neo_hookean.cauchy(Q.T @ F(1.0) @ Q, 0.0)[1, 1]
    return exactly(f"a, b, d = {a:g}, {b:g}, {d:g}", body, solution, F(1.0), pressure)


#: Any F: a rotation, a shear in any direction, a stretch; and P over mu_L.
LOADED = (([[0.8, -0.6], [0.6, 0.8]], 0.4), ([[1.7, 2.1], [-0.8, 1.1]], -1.3), ([[-31.0, 45.0], [-42.0, -3.0]], 0.02))


@pytest.mark.case(
    "growth-patch-traction", kind="exact", norm=NORM,
    mutants=("theta-power", "third-power", "untransposed", "one-corner-pressure", "forces-pushed", "forces-halved"),
    references=("neo_hookean",))
@parametrize("kind", bodies.EVERY)
def test_patch_traction(kind, record):
    """A body of straight or curved triangles has F and P inside if three sides are prescribed as F X and the traction
    of F and P pulls the fourth: for any F, with rotations, shears and J to 2000, and any P.
    """
    record([_pulled(kind, np.array(F), P) for F, P in LOADED])


def _pulled(kind: int, F: np.ndarray, P: float) -> list[Check]:
    """Check a body whose right side is pulled, from perturbed positions."""
    grid, side = bodies.rectangle(SIZES[kind], 8, kind)
    inside = ~np.any([*side.values()], axis=0)
    shake = np.random.default_rng(9).uniform(-1, 1, grid.points.shape) * inside[:, None] * SHAKEN[kind]
    J, constrained = np.linalg.det(F), side["left"] | side["bottom"] | side["top"]
    S = J * neo_hookean.cauchy(F, P)[:2, :2] @ np.linalg.inv(F).T
    body = bodies.on_mesh(grid, constrained, constrained)
    forces = bodies.traction(body, grid, lambda x, y: S)
    solution = bodies.equilibrium(body, body.constant(J), (grid.points + shake) @ F.T, forces)
    return exactly(f"F = {F.tolist()}, P = {P:g}", body, solution, F, P)


REFINEMENTS = {1: (1.3, 2.2, 3.5, 6.0), 2: (0.3, 0.6, 1.2, 2.4)}
SECOND = "linear elements: second order"
LAYER = "3/2 from a layer of one element at the rim, where the stabilisation imposes dP/dn = 0"


def exact(top: float) -> bodies.HalfCylinder:
    """theta: a third of ``top`` in the middle, ``top`` on the rim."""
    return bodies.HalfCylinder(top / 3, top)


def errors(refinement: float, top: float, kind: int = 1) -> dict[str, float]:
    """Element size, largest error of the outline's radius, and L2 errors of positions and pressure."""
    body, rim = bodies.half_disc(refinement, kind)
    reference = exact(top)
    solution = bodies.grow(body, body.field(reference.theta))
    start, end = (np.hypot(*places[rim].T) for places in (body.reference, solution.position))
    return {"outline": largest(end / reference.radius(start) - 1),
            **bodies.errors(body, solution, reference.at)}


@pytest.mark.slow
@pytest.mark.case(
    "growth-half-cylinder", kind="exact",
    mutants=("stabilisation-power", "stabilisation-too-weak", "stabilisation-of-rest", "stabilisation-sign",
             "theta-power"), runs_with="1", omitted="order 2: growth-curved-half-cylinder")
def test_half_cylinder(record):
    """A half-disc that grows by theta(R), 36 on the rim, becomes the exact half-disc, with the exact pressure.

    Norm: largest relative error of the outline's radius; L2 of positions and of the pressure over the body at t = 0,
    relative.
    """
    record(studies(refine(errors, REFINEMENTS[1], 36.0), {
        "outline": (2, SECOND, 2e-4), "place": (2, SECOND, 2e-4), "pressure": (1.5, LAYER, 3e-3)}))


@pytest.mark.slow
@pytest.mark.case(
    "growth-curved-half-cylinder", kind="exact", mutants=("grad-div-dropped", "theta-power"),
    runs_with="2", omitted="order 1: growth-half-cylinder")
def test_curved_half_cylinder(record):
    """A curved half-disc that grows by theta(R) becomes the exact half-disc, with positions of third order and a
    pressure of second, and with equal errors at theta = 2000 and at 36.

    Norm: largest relative error of the outline's radius; L2 of positions and of the pressure over the body at t = 0.
    """
    computed = refine(errors, REFINEMENTS[2], 36.0, 2)
    record(studies(computed, {"place": (around(3, 0.4), "quadratic places: third order in L2", 1e-5),
                           "pressure": (2, "linear pressure: second order in L2", 2e-3)}, ", theta to 36"))
    record(at_most("outline, theta to 36", computed["outline"][-1], 1e-5, "under that of positions in L2"))
    large = errors(REFINEMENTS[2][-2], 2000.0, 2)
    for name in ("outline", "place", "pressure"):
        record(at_most(f"{name}, theta to 2000", large[name], 1.05 * computed[name][-2],
                       "as at theta = 36: the error depends on the shape of theta(R), not on its size"))


ROUND_OFF, STEPS = "round-off", 0.1 * 0.5 ** np.arange(4)


def central_differences(name: str, slope: np.ndarray, value) -> Study:
    """The study of central differences of value(s) at s = 0 against its slope."""
    errors = [largest((value(s) - value(-s)) / (2 * s) - slope) for s in STEPS]
    return study(name, STEPS, errors, 2, "central differences: second order")


def _along(body: Supported, theta, place, pressure, move, push):
    """Element tangents, the slope of the residual along a direction, and the residual after a step s."""
    system = bodies.system(body, place, pressure, theta)
    tangents = system.tangent(place, pressure)
    linear = system.sparse.product(tangents, np.concatenate([*move.T, push]))
    return tangents, linear, lambda s: system.residual(place + s * move, pressure + s * push)


@pytest.mark.case(
    "growth-curved-taylor", kind="property",
    mutants=("tangent-without-grad-div", "constraint-sign", "stress-transposed", "element-tangent-coefficient"))
@parametrize("kind", bodies.EVERY)
def test_curved_taylor(kind, record):
    """On straight triangles, and on curved ones with their inner edges bent, the element tangent is the derivative of
    the residual and is symmetric.

    Norm: remainder of a first-order Taylor expansion; largest difference.
    """
    grid, side = bodies.rectangle(1.6, 4, kind)
    body = bodies.on_mesh(grid, side["left"], side["bottom"])
    random, theta = np.random.default_rng(6), body.constant(1.4)
    position = grid.points @ np.array([[1.2, 0.1], [0.2, 1.1]])
    push, move = random.standard_normal(body.corners), 0.05 * random.standard_normal(position.shape)
    push_step, steps = random.standard_normal(body.corners), 0.25 * 0.5 ** np.arange(4)
    tangents, linear, residual = _along(body, theta, position, push, move, push_step)
    remainders = [largest(residual(s) - residual(0.0) - s * linear) for s in steps]
    record(at_most("symmetry", largest(tangents - tangents.mT) / largest(tangents), 1e-13, ROUND_OFF),
           study("residual", steps, remainders, 2, "Taylor's theorem: second order", band=0.25))


@pytest.mark.case(
    "growth-stabilisation", kind="exact", mutants=(
        "stabilisation-power", "stabilisation-too-weak", "stabilisation-diagonal", "h-not-squared", "circumradius"),
    runs_with="1", omitted="order 2: the pressure is not stabilised")
def test_stabilisation(record):
    """On a pressure of constant gradient g the stabilisation of a triangle is |tau| h^2 theta^(2/3) / 12 |g|^2, h the
    diameter of the circle through its corners [E6].

    Norm: largest relative difference over the triangles of a random mesh.
    """
    grid, _ = bodies.rectangle(1.3, 6)
    points, triangles = grid.points, grid.triangles
    theta, g = np.random.default_rng(7).uniform(1, 2000, len(triangles)), np.array([0.3, -0.7])
    corner = points[triangles]
    area = np.linalg.det(corner[:, 1:] - corner[:, :1]) / 2
    h = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2).prod(axis=1) / (2 * area)
    exact = area * h**2 * theta ** (2 / 3) / 12 * (g @ g)
    pressure = (points @ g)[triangles]
    computed = np.einsum("ta,tab,tb->t", pressure, growth.gradient_stabilisation(points, triangles, theta), pressure)
    record(at_most("stabilisation", largest(computed / exact - 1), 1e-11, ROUND_OFF))
