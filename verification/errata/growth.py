"""E5, E6, E11, E17: the growing body, against closed forms; E8, E15: fields on a new mesh, and the motion of a mesh."""

from dataclasses import dataclass
from functools import cache
from itertools import pairwise, product

import numpy as np
from scipy.optimize import brentq
from scipy.spatial import Delaunay

from reference import neo_hookean
from repro.fem import transfer
from repro.fem.outline import half_disc as seed
from repro.fem.sizing import ACROSS_AGGREGATE
from repro.model import growth, mesh_motion
from verification.claims.growth_mechanics import sliding, stabilised_by
from verification.claims.runs import BASE, biomass_defects, half_disc, load_packaged
from verification.errata import Numbers, erratum, percent, small
from verification.evidence.writing import table
from verification.problems import meshes, pairs
from verification.problems.bodies import RADIUS, HalfCylinder, Supported, grow
from verification.switches import CHOICES

#: Elements across the radius; stabilisations of E6.
RINGS = (7, 10, 14)
KINDS = ("none", "at t = 0: h_0^2 / (12 mu_L)", "present shape, mu_L", "present shape, mu_L theta^(-2/3) (ours)")


@dataclass(frozen=True, eq=False)
class Cylinder:
    """A half-disc of radius 1 with theta = inner + more R^2, and its exact growth (reference/neo_hookean.py).

    body; theta (t, 1) at the triangles' middles; position (n, 2), pressure (n,): exact.
    """

    body: Supported
    theta: np.ndarray
    position: np.ndarray
    pressure: np.ndarray

    def pressure_error(self, pressure: np.ndarray) -> float:
        """Relative L2 error over the grown body."""
        mesh = self.position, self.body.cells
        return float(np.sqrt(pairs.square(mesh, pressure - self.pressure) / pairs.square(mesh, self.pressure)))

    def place_error(self, position: np.ndarray) -> float:
        """Largest error of a position over the radius."""
        return float(np.linalg.norm(position - self.position, axis=1).max() / self.position[:, 0].max())


@cache
def half_disc_body(rings: int) -> Supported:
    """A half-disc of radius 1 on its frictionless wall, its middle fixed: rings of nodes, shaken (seed 2001)."""
    polar = [(k / rings, angle) for k in range(rings + 1) for angle in np.linspace(0, np.pi, 3 * k + 1)]
    R, angle = np.array(polar).T
    flat, rim = (angle == 0) | (angle == np.pi), R == 1
    points = R[:, None] * np.column_stack([np.cos(angle), np.where(flat, 0.0, np.sin(angle))])
    shake = np.random.default_rng(2001).uniform(-0.2, 0.2, points.shape) / rings
    points += np.where((flat | rim)[:, None], 0.0, shake)
    return sliding(*pairs.upright(points, Delaunay(points).simplices))


def cylinder(rings: int, inner: float, increase: float) -> Cylinder:
    """The growing half-cylinder."""
    body, exact = half_disc_body(rings), HalfCylinder(inner, inner + increase)
    places = RADIUS * body.reference.T
    return Cylinder(body, body.field(lambda x, y: inner + increase * (x**2 + y**2)), exact.place(*places) / RADIUS,
                    exact.pressure(*places))


@erratum(
    "E5", "the sign of the stabilisation in (27)",
    printed="""(21) and (27) add P (J - theta), (22) subtracts it; (27) then adds + 1/2 sum h^2 / (12 mu_L)
        |grad P|^2.""",
    reading="""The sign of P (J - theta) only determines the sign of P: with plus, P is the mean stress, "the
        opposite of the hydrostatic pressure" of the text before (21). The stabilisation must be **subtracted**:
        the solution is a saddle point of Pi, a minimum in phi and a maximum in P. A positive term in P opposes this
        maximum.""",
    consequence="""
        The first Newton step of a half-cylinder with theta = 1 + 1e-4 (3/4 + R^2 / 2) on three meshes: the number of
        negative eigenvalues of the matrix (a saddle point has one for each pressure), the condition, and the
        relative L2 error of the pressure.

        {table}

        With the printed sign most of these eigenvalues are positive: as the stabilisation rises from zero to the
        printed one, the matrix becomes singular once for each of them. A solver may return a solution with the printed
        sign, but it is noise; finer meshes do not help. Without the term the pressure of this smooth case is less
        accurate, and the condition of the matrix is hundreds of times worse.""",
    quick=True)
def stabilisation_sign() -> Numbers:
    """Inertia, condition and error with the stabilisation subtracted, left out, and added."""
    rows = [[name, *first_step(cylinder(rings, 1 + 0.75e-4, 0.5e-4), sign)]
            for name, sign in (("subtracted (ours)", 1.0), ("none", 0.0), ("added (printed)", -1.0))
            for rings in RINGS]
    return {"table": table(["stabilisation", "pressures", "negative eigenvalues", "condition", "error of P"], rows)}


def first_step(case: Cylinder, sign: float) -> list[str]:
    """Pressures, negative eigenvalues, condition, and error of P after one Newton step from the reference."""
    body, count = case.body, len(case.pressure)
    system = stabilised_by(body, sign)
    first = system.under(case.theta, body.reference, body.reference, np.zeros(count))
    tangent = system.tangent(first.position, first.pressure)
    values = np.linalg.eigvalsh(system.sparse.matrix(tangent).toarray())
    step = system.sparse.solve(tangent, -first.residual)
    condition, error = np.abs(values).max() / np.abs(values).min(), case.pressure_error(step[2 * count:])
    return [str(count), str(np.count_nonzero(values < 0)), f"{condition:.0e}", f"{100 * error:.2g} %"]


@erratum(
    "E6", "the configuration of the stabilisation in (27)",
    printed="""The stabilisation in (27) is an integral over the elements in dv, which denotes the present volume in
        (30). The other integrals of (27) are over Omega_B0 in dV. The paper does not say to which shape h_tau and grad
        P belong;
        mu_L is the modulus at t = 0.""",
    reading="""We take h, grad and dv of the present shape, and mu_L theta^(-2/3) instead of mu_L. This is the modulus
        of an increment of the deformation there, as A = mu_L J^(-2/3) multiplies the deviatoric stress. In quantities
        of t = 0 this is
        J^(5/3) times h^2 / (12 mu_L). The stabilised problem is then the same for small and for large growth.""",
    consequence="""
        Half-cylinder grown by theta = m (3/4 + R^2 / 2), equilibrium against the closed form, on three meshes
        ({nodes} nodes): relative L2 error of the pressure, then its largest nodal error over the largest
        pressure.

        {table}

        The term of t = 0 falls to {fade_36} and {fade_2000} of the matched one, so the pressure at theta = 2000 is
        that without stabilisation. With ours the error is the same for both m. Positions err by at most {places} of the
        radius on all meshes in all cases: the choice affects the stresses alone.""",
    quick=True)
def stabilisation_scale() -> Numbers:
    """Errors of pressure and places at theta = 36 and 2000 for four stabilisations."""
    rows, places = [], 0.0
    for mean, name in product((36, 2000), KINDS):
        cases = [cylinder(rings, 0.75 * mean, 0.5 * mean) for rings in RINGS]
        errors = [equilibrium_errors(case, stabilisations(case)[name]) for case in cases]
        rows.append([f"{mean}", name, *(f"{100 * p:.1f} %, {100 * worst:.0f} %" for p, worst, _ in errors)])
        places = max(places, *(x for _, _, x in errors))
    nodes = ", ".join(str(len(half_disc_body(rings).reference)) for rings in RINGS)
    head = ["m", "stabilisation", *(f"element size R / {rings}" for rings in RINGS)]
    fades = {f"fade_{mean}": f"1 / {mean ** (5 / 3):.3g}" for mean in (36, 2000)}
    return {"table": table(head, rows), "nodes": nodes, "places": f"{100 * places:.1f} %", **fades}


def stabilisations(case: Cylinder) -> dict[str, np.ndarray]:
    """(t, 3, 3) stabilisations: none, that of t = 0, and those of the present shape with the modulus of t = 0 and with
    the present modulus."""
    cells, ones = case.body.cells, np.ones(len(case.theta))
    start = growth.gradient_stabilisation(case.body.reference, cells, ones)
    present = [growth.gradient_stabilisation(case.position, cells, expansion)
               for expansion in (ones, case.body.strained(case.position).J[:, 0])]
    return dict(zip(KINDS, (0 * start, start, *present)))


def equilibrium_errors(case: Cylinder, matrices: np.ndarray) -> tuple[float, float, float]:
    """Errors of the equilibrium that Newton's method reaches from the exact one: of the pressure in L2 and at its worst
    node, and of the positions. Raises GrowthError if it does not converge.
    """
    system = growth.System(case.body, case.body.constrained, stabilisation=growth.PressureGradient(matrices))
    exact = growth.Equilibrium(case.position, case.pressure, 0)
    solution = growth.reach(system, case.theta, case.theta, exact, case.position)
    worst = np.abs(solution.pressure - case.pressure).max() / np.abs(case.pressure).max()
    return case.pressure_error(solution.pressure), worst, case.place_error(solution.position)


@erratum(
    "E11", "uniform growth is not free of stress",
    printed="""(14)-(17) split C by J^(2/3), "as the material is inherently three-dimensional", while the strain
        is plane (F33 = 1).""",
    reading="""As printed. Growth then acts like heating in plane strain, which prevents expansion along the third
        axis. F = sqrt(theta) I has no in-plane shear, but sigma = 0 in the plane requires P = -mu_L
        theta^(-5/3) (theta - 1) / 3, and across it the stress is compressive. A multiplicative split F = F_e
        F_g with in-plane F_g would have no stress.""",
    consequence="""
        A half-disc that grows uniformly from t = 0, in steps of a factor of 1.5 at most:

        {table}

        The computed pressure is exact. It scales with mu_L and does not change the shape; it matters for stresses
        alone. It is largest at theta = 2.5, {kilopascal} kPa with Table 1's mu_L = 0.01 MPa, and then decreases
        as the body grows.""",
    quick=True)
def uniform_growth() -> Numbers:
    """Pressure, out-of-plane stress and radius of a half-disc grown by theta, against the closed form."""
    rows, body = [], half_disc_body(10)
    for theta in (2.0, 36.0, 2000.0):
        solution = grow(body, body.constant(theta))
        exact = neo_hookean.free_growth_pressure(theta)
        across = neo_hookean.cauchy(np.sqrt(theta) * np.eye(2), exact)[0, 0] + theta ** (-5 / 3) * (1 - theta)
        radius = np.linalg.norm(solution.position, axis=1).max()
        errors = np.abs(solution.pressure / exact - 1).max(), radius / np.sqrt(theta) - 1
        rows.append([f"{theta:g}", f"{exact:.5f}", f"{across:.5f}", *map(small, errors)])
    head = ["theta", "P / mu_L", "stress across the plane / mu_L", "largest error of P", "error of the radius"]
    return {"table": table(head, rows), "kilopascal": f"{10 * neo_hookean.free_growth_pressure(2.5):.2f}"}


@erratum(
    "E17", "the penalty (19) softens as the aggregate grows",
    printed="(19): U = kappa/2 (J / theta - 1)^2 with a constant kappa. According to the paper, (21) is its limit.",
    reading="""The multiplier of (21), as in the rest of the scheme. In (19) the counterpart of P is kappa (J / theta
        - 1) / theta. At a given pressure the relative error of the volume is P theta / kappa, so kappa would have
        to grow with theta for the same accuracy.""",
    consequence="""
        J / theta - 1 of a body that grows uniformly and freely under (19):

        {table}

        For large kappa it is -mu_L theta^(1/3) / (3 kappa): the error grows although the pressure falls (E11),
        and with a small kappa the body does not grow (no J between theta / 2 and theta).""",
    quick=True)
def penalty() -> Numbers:
    """Volume error of uniform free growth under (19), from dPsi/dJ = 0."""
    rows = []
    for ratio in (10.0, 100.0, 1e4):
        rows.append([f"{ratio:g}", *(volume_error(theta, ratio) for theta in (2.0, 36.0, 2000.0))])
    return {"table": table(["kappa / mu_L", "theta = 2", "theta = 36", "theta = 2000"], rows)}


def volume_error(theta: float, ratio: float) -> str:
    """J / theta - 1 at equilibrium of uniform plane growth under (17) and (19), for kappa / mu_L, J over theta / 2."""
    def slope(J):
        return ratio * (J / theta - 1) / theta - neo_hookean.free_growth_pressure(J)
    if slope(theta / 2) > 0:
        return "no such J"
    return f"{100 * (brentq(slope, theta / 2, theta, xtol=1e-14, rtol=1e-14) / theta - 1):.2g} %"


LINEAR = CHOICES["linear transfer"].run


@erratum(
    "E8", "linear interpolation at a remesh",
    printed="""At a remesh the values at the new nodes are interpolated linearly in the old mesh (3.5), X_A and
        X_I among them.""",
    reading="""Interpolation does not conserve mass. The default does: it projects X_A and X_I by Galerkin's method
        over the common pieces of both meshes. `replace(PAPER, transfer="interpolation")` is the paper's transfer.""",
    consequence="""
        Relative defects of the mass of X_A + X_I, in the worst step or remesh and in a whole run:

        {table}

        In base X is X_m nearly everywhere, so interpolation changes little. The chain carries exp(-(R - r) /
        l), l = 6 um, in a half-disc of R = 30 um through 40 unrelated meshes of the default size. This field is
        convex, so interpolated values are always too large. The projection conserves the mass, but is not bounded
        by the old values: it exceeds the largest one by up to {overshoot}.""")
def transfers() -> Numbers:
    """Mass defects in base and in a chain of remeshes."""
    rows = []
    for name, run in (("linear", LINEAR), ("conserving", BASE)):
        defects = biomass_defects(run)
        masses, largest = chain(name)
        steps, remaining = np.diff(masses) / masses[:-1], masses[-1] / masses[0]
        rows.append([name, small(np.abs(defects).max()), small(np.sum(defects)), small(np.abs(steps).max()),
                     percent(remaining, 0) if name == "linear" else small(remaining - 1)])
    head = ["transfer", "base: worst step", "base: whole run", "chain: worst remesh", "chain: 40 remeshes"]
    return {"table": table(head, rows), "overshoot": f"{100 * (largest - 1):.1f} %"}


#: Methods that transfer the field of :func:`chain` to the next mesh.
TRANSFER = {"linear": transfer.interpolated, "conserving": transfer.project}


def chain(method: str) -> tuple[np.ndarray, float]:
    """Masses (41,) of a steep field through a chain of remeshes of one half-disc, and its largest value."""
    outline = seed(30.0, ACROSS_AGGREGATE)
    refinements = 1 + 0.3 * (0.618 * np.arange(41) % 1)
    grids = [meshes.around(outline, refinement, (-105.0, 105.0), 50.0)[0] for refinement in refinements]
    bodies = [(grid.points[grid.body], grid.topology.body_cells) for grid in grids]
    fields = [np.exp((np.linalg.norm(bodies[0][0], axis=1) - 30.0) / 6.0)[:, None]]
    for old, new in pairwise(bodies):
        fields.append(TRANSFER[method](*old, fields[-1], *new))
    masses = [pairs.integral(body, field[:, 0]) for body, field in zip(bodies, fields)]
    return np.array(masses), max(float(field.max()) for field in fields)


@erratum(
    "E15", "the sign of gamma in (35)",
    printed="""(35): div u - gamma P~ = 0, in the place of (2) in the Stokes flow formulation, whose (1) reads
        lap u - grad P~ = 0.""",
    reading="""div u + gamma P~ = 0. Then -lap u - grad(div u) / gamma = 0, an elastic body that resists
        compression. As printed the second term changes sign: a compression wave then has the stiffness 1 -
        1 / gamma, which is zero at gamma = 1 and negative below. For some values of gamma between 0 and 1 (the
        Cosserat spectrum of the domain) there is no solution. (With the opposite sign of grad P~ in the momentum
        equation the printed sign would be right; the paper does not repeat that equation.)""",
    consequence="""
        The mesh around a half-disc of R = 10 um in a 50 um pore follows a growth of its radius by 10 %. Largest
        displacement of a fluid node over that of the interface (one is right), and smallest quality of a
        triangle (negative: turned over):

        {table}

        With most values of gamma the mesh stays acceptable under the printed sign. Near a resonance the
        displacements are far too large. The mesh decides which values of gamma are near a resonance.""",
    quick=True, spread=10.0)
def compressibility_sign() -> Numbers:
    """Mesh motion with both signs of gamma."""
    grid = half_disc(load_packaged("initial_mesh"), 10.0, 75.0)
    body, rows = 1.1 * grid.points[grid.body], []
    for gamma in (0.1, 0.5, 0.7, 0.8, 0.9, 1.0, 2.0):
        moved = [grid.moved(mesh_motion.move(grid, body, sign * gamma)) for sign in (1, -1)]
        farthest = [np.linalg.norm(m.points - grid.points, axis=1).max() for m in moved]
        rows.append([f"{gamma:g}", *(f"{d:.2f}, {m.quality.min():.2f}" for d, m in zip(farthest, moved))])
    return {"table": table(["gamma", "div u + gamma P~ = 0 (ours)", "div u - gamma P~ = 0 (printed)"], rows)}
