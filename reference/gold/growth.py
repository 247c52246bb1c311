"""Uniform growth into a wall, into a plane of symmetry, and on a wall to which an aggregate is bonded, by NGSolve.

    make gold

writes ``growth.json``. It needs NGSolve (``.ci/gold.lock``) and nothing of this project.

A half-disc grows by a uniform theta in plane strain. It is incompressible and neo-Hookean, (14)-(17) and (21)-(24), so
at a position phi of the point X with F = d phi / d X it makes

    integral of mu / 2 theta^(-2/3) F : F + p (det F - theta) dV

stationary. The paper's energy has J^(-2/3) (F : F + 1); as J = theta, the two differ by a pressure. The Cauchy stress
over mu is theta^(-5/3) F F^T + p / mu; with F33 = 1 its value across the plane is theta^(-5/3) + p / mu.

*Elements.* Positions of fourth order and pressures of third order, curved elements that shrink towards the contact
lines. Only the half x > 0 has elements. Each number is computed on two meshes. The second has elements of half the size
and gives the number. The bar is the difference between the two.

*Contact* (2.3.3). The lower wall is without friction. The arc above the angle of the contact line lies on the upper
wall, along which it slides. The line is the first one at which every point of the free surface, at a distance d from
the line along the wall, has a gap to the wall of at least

    min(film, tan(16.7 degrees) d).

At the line, gap and bound are zero. Beside it the surface opens like the root of d, faster than the bound. The rule is
tested from 1e-5 um on, and binds at 2.8 to 6.7 um (``binds_um``): it does not matter from which distance below that it
is tested.

*A weld.* Two equal aggregates that face each other in a pore of twice the width join like one that touches the plane of
symmetry between them, without friction. The film between them is twice the gap to the plane, so the gap has half of the
film and half of the tangent.

*A bonded wall* keeps its points in place. Within about (theta - 1)^(5/2) R / 30 of its edge the strain is of order one
and the free surface turns over to the wall. The rule would close the wedge there, which this script leaves out: the
smallest elements are not smaller than this zone. It is thinner than a thousandth of the length of the means.

*Numbers.* Lengths in um, stresses over mu_L. ``wall_traction``: the largest mean over W / 20, along the wall, of the
traction that a wall bears, ((max(pull, 0))^2 + shear^2)^(1/2) of the mean pull and the mean shear; a shorter surface
has one mean. ``tensile_stress``: the largest principal value of the mean stress around a point. The mean has the weight
1 - (d / L)^2 at a distance d < L = W / 20 from the point.
"""

import json
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
from netgen.occ import ArcOfCircle, Face, OCCGeometry, Pnt, Segment, Wire
from ngsolve import (
    H1,
    SEGM,
    TRIG,
    VOL,
    BilinearForm,
    CoefficientFunction,
    Cof,
    Det,
    Grad,
    GridFunction,
    Id,
    InnerProduct,
    IntegrationRule,
    Inv,
    LinearForm,
    Mesh,
    Norm,
    Parameter,
    VectorH1,
    cos,
    ds,
    dx,
    sin,
    specialcf,
    sqrt,
    x,
    y,
)

FOLDER = Path(__file__).parent
#: Order of the positions.
ORDER = 4
#: Largest elements on the coarser mesh, and those at contact lines on the upper wall, over the radius.
SIZE, AT_LINES = 0.2, 1e-4
#: Elements at the edge of a bonded wall, over the radius, for theta = 1 + BONDED_GROWTH. They are larger for a larger
#: theta, because Newton's method finds no equilibrium if they resolve the zone where the surface turns over.
AT_BONDED, BONDED_GROWTH = 1e-3, 0.05
#: Width of the pore, or of its half with a plane of symmetry (um).
WIDTH = 50.0
#: Length of the means over the width.
LENGTH = 1 / 20
#: Radius of the seed that grows into the upper wall, or into a plane (um), its thetas, and first guesses of the angle
#: (rad) of its contact line. The film closes at theta = (48 / 5)^2 = 92.16, that at the plane at (49 / 5)^2 = 96.04.
SEED, TOUCHING, WELDED = 5.0, {94.0: 1.3, 102.0: 1.2, 120.0: 1.0, 148.0: 0.9}, {98.0: 1.3, 106.0: 1.2, 122.0: 1.0}
#: Radii (um) of bonded half-discs, and their thetas.
BONDED = (5.0, 1.05), (20.0, 1.05), (45.0, 1.05), (20.0, 1.1), (20.0, 1.15)
#: The first part of theta and of prescribed positions, and the growth of parts from one equilibrium to the next.
FIRST_STEP, LONGER = 0.02, 1.5
#: Newton's method stops at a correction of this, over the radius.
NEWTON = 1e-11
MOST_ITERATIONS = 10
#: The line is known if its clearance is smaller than this.
CLOSE = 1e-9
#: Longest change of the line's angle (rad) in its search.
LONGEST_TURN = 0.08
#: Points at which the tensile stress is computed to the end.
CANDIDATES = 400
#: The numbers with bars.
BARRED = {"length_um", "tip_um", "thickness_um", "wall_traction", "tensile_stress"}
#: Places on each edge of the free surface, and between two points at which the rule is tested (um).
PER_EDGE, APART = 40, 0.002
#: Parts of an edge on a wall, and the part of the length of a mean in which the traction at an end is uniform.
PARTS, BESIDE = 32, 0.05
#: Order of the quadrature of means.
QUADRATURE = 20


class Rule(NamedTuple):
    """The rule for contact (2.3.3): least film (um), and tangent of the least angle."""

    film: float
    slope: float


#: Those of Table 1, and half of them at a plane of symmetry.
AT_WALL = Rule(2.0, math.tan(math.radians(16.7)))
AT_PLANE = Rule(*(part / 2 for part in AT_WALL))


class Surface(NamedTuple):
    """The half x > 0 of a wall's surface: x (n,) um, rising from 0, and the body's pull and shear (n - 1,) on the wall
    between two of them."""

    x: np.ndarray
    pull: np.ndarray
    shear: np.ndarray

    def largest_mean(self) -> tuple[float, float]:
        """The largest mean traction, and the x (um) of the middle of its length."""
        length = min(LENGTH * WIDTH, 2 * self.x[-1])
        totals = [np.append(0, np.cumsum(forces)) for forces in (self.pull, self.shear)]
        # The density oscillates beside a singular end: there it is replaced by its mean.
        kept = (self.x < self.x[-1] - BESIDE * length) | (self.x == self.x[-1])
        half, places = self.x[kept], np.concatenate([-self.x[kept][:0:-1], self.x[kept]])
        pull, shear = totals[0][kept], totals[1][kept]
        pull, shear = np.concatenate([-pull[:0:-1], pull]), np.concatenate([shear[:0:-1], shear])
        starts = np.concatenate([places, places - length])
        starts = starts[(starts >= -half[-1]) & (starts <= half[-1] - length)]
        means = [(np.interp(starts + length, places, total) - np.interp(starts, places, total)) / length
                 for total in (pull, shear)]
        bears = np.hypot(np.maximum(means[0], 0), means[1])
        worst = bears.argmax()
        return float(bears[worst]), float(starts[worst] + length / 2)


class Body:
    """The half x > 0 of a half-disc at a theta, in equilibrium.

    Its elements are those of a body with the contact line at one angle. Points between the axes turn about the origin,
    X = R(a) M with a = ``turn`` sin(2 angle) (r / radius)^2, and so the contact line has any angle near by.
    """

    def __init__(self, radius: float, theta: float, size: float, line: float | None = None, bonded: bool = False):
        """line: angle (rad) above which the arc lies on the upper wall; None without contact."""
        self.radius, self.first, self.bonded = radius, line, bonded
        smallest = AT_BONDED * ((theta - 1) / BONDED_GROWTH) ** 1.5 if bonded else AT_LINES
        self.mesh = Mesh(_geometry(radius, size, line, smallest).GenerateMesh(maxh=size * radius, grading=0.4))
        self.mesh.Curve(ORDER)
        self.space = (VectorH1(self.mesh, order=ORDER, dirichletx="axis|bottom" if bonded else "axis",
                               dirichlety="bottom|top") * H1(self.mesh, order=ORDER - 1))
        self._theta, self._turn = Parameter(1.0 if bonded else theta), Parameter(0.0)
        self.solution = GridFunction(self.space)
        self.position, self.pressure = self.solution.components
        self._define()
        self.position.Set(sqrt(self._theta) * self._origin)
        self.pressure.Set(-(self._theta ** (-2 / 3)))
        lift = GridFunction(self.space)
        if line is not None:
            lift.components[0].components[1].Set(WIDTH - sqrt(self._theta) * self._origin[1],
                                                 definedon=self.mesh.Boundaries("top"))
        self._change(self._theta, theta, FIRST_STEP, lift.vec)

    def _change(self, parameter: Parameter, last: float, step: float, lift=None) -> None:
        """Change a parameter, and move prescribed positions by ``lift``, in steps; step: the first part of the change.

        A step that fails is halved.
        """
        first, moved = parameter.Get(), None
        done = 0.0
        while done < 1:
            before, step = self.solution.vec.CreateVector(copy=True), min(step, 1 - done)
            parameter.Set(first + (done + step) * (last - first))
            if lift is not None:
                moved = lift.CreateVector()
                moved.data = step * lift
            try:
                self._solve(moved)
                done, step = done + step, LONGER * step
            except RuntimeError:
                self.solution.vec.data = before
                step /= 2
                if step < FIRST_STEP / 1000:
                    raise

    def _define(self) -> None:
        """The potential, and the forces on the boundary."""
        angle = 2 * self._turn / self.radius**2 * x * y
        along = 2 * self._turn / self.radius**2 * CoefficientFunction((y, x))
        turned = CoefficientFunction((cos(angle), -sin(angle), sin(angle), cos(angle)), dims=(2, 2))
        self._origin = turned * CoefficientFunction((x, y))
        across = CoefficientFunction((-self._origin[1], self._origin[0]))
        self._gradient = turned + CoefficientFunction((across[0] * along[0], across[0] * along[1],
                                                       across[1] * along[0], across[1] * along[1]), dims=(2, 2))
        theta, volume, backwards = self._theta, Det(self._gradient), Inv(self._gradient)
        shear = theta ** (-2 / 3)
        F, swollen = Grad(self.position) * backwards, Cof(Grad(self.position))
        self.cauchy = shear / theta * F * F.trans + self.pressure * Id(2)
        self.across = shear / theta + self.pressure
        (u, p), (v, q) = self.space.TnT()
        whole = dx(bonus_intorder=4)
        # Residual and tangent of shear / 2 volume F : F + pressure (det Grad(position) - theta volume).
        weighted = shear * volume * F * backwards.trans + self.pressure * swollen
        self._residual = LinearForm(self.space)
        self._residual += (InnerProduct(weighted.Compile(), Grad(v))
                           + (Det(Grad(self.position)) - theta * volume).Compile() * q) * whole
        metric = (shear * volume * backwards * backwards.trans).Compile()
        self._tangent = BilinearForm(self.space, symmetric=True)
        self._tangent += (InnerProduct(Grad(u) * metric, Grad(v)) + self.pressure * InnerProduct(Cof(Grad(u)), Grad(v))
                          + p * InnerProduct(swollen, Grad(v)) + q * InnerProduct(swollen, Grad(u))) * whole

    def _solve(self, moved=None) -> None:
        """Newton's method. moved: changes of prescribed positions. Raises RuntimeError if it does not converge."""
        free = self.space.FreeDofs()
        residual, change = self.solution.vec.CreateVector(), self.solution.vec.CreateVector()
        scale = self.radius * math.sqrt(self._theta.Get())
        corrections = []
        while len(corrections) < MOST_ITERATIONS:
            self._residual.Assemble()
            self._tangent.Assemble()
            residual.data = self._residual.vec
            if moved is not None:
                residual.data += self._tangent.mat * moved
            change.data = self._tangent.mat.Inverse(free, inverse="umfpack") * residual
            self.solution.vec.data -= change
            if moved is not None:
                self.solution.vec.data += moved
                moved = None
            corrections.append(np.abs(change.FV().NumPy()[: self.space.components[0].ndof]).max() / scale)
            if len(corrections) > 1 and corrections[-1] < NEWTON:
                return
            if len(corrections) > 2 and corrections[-1] > corrections[-2] / 2:
                break
        raise RuntimeError(f"no equilibrium: the last correction is {corrections[-1]:.1e}")

    def turn(self, line: float) -> None:
        """Put the contact line at another angle."""
        self._change(self._turn, (line - self.first) / math.sin(2 * self.first), 1.0)

    def shape(self, part: str) -> np.ndarray:
        """(n, 2) um, places of a part of the boundary, by rising x."""
        places = self.position(self._on(part, np.linspace(0, 1, PER_EDGE + 1)))
        return places[np.argsort(places[:, 0], kind="stable")]

    def clearance(self, rule: Rule) -> tuple[float, float]:
        """The least value of gap / min(film, slope d) - 1 over distances d from the contact line, and the d (um) where
        it is. The smallest d is 1e-5 um."""
        free = self.shape("free")
        line = free[0, 0] if self.first is None else self.shape("top")[-1, 0]
        free = free[free[:, 1] > WIDTH / 2]
        distance = np.unique(np.concatenate([np.geomspace(1e-5, 1, 2000), np.arange(1, 8, APART),
                                             [rule.film / rule.slope],
                                             free[:, 0] - line]))
        distance = distance[(distance > 0) & (distance <= free[-1, 0] - line)]
        gap = WIDTH - np.interp(distance, free[:, 0] - line, free[:, 1])
        ratio = gap / np.minimum(rule.film, rule.slope * distance) - 1
        return float(ratio.min()), float(distance[ratio.argmin()])

    def surface(self, wall: str) -> Surface:
        """The surface on a wall: "bottom" or "top". Its tractions are those of the nodal forces.

        At x = 0 the forces along x are those of the axis; the shear is zero there, and on a wall without friction.
        """
        scalar = H1(self.mesh, order=ORDER)
        region = self.mesh.Boundaries(wall)
        u, v = scalar.TnT()
        mass = BilinearForm(u * v * ds(definedon=region)).Assemble()
        on_wall = scalar.GetDofs(region)
        sheared = on_wall & ~scalar.GetDofs(self.mesh.Boundaries("axis" if self.bonded else ".*"))
        self._residual.Assemble()
        forces = GridFunction(self.space)
        forces.vec.data = self._residual.vec
        ends = np.linspace(0, 1, PARTS + 1)
        inside = (ends[:-1, None] + np.array([3 - math.sqrt(3), 3 + math.sqrt(3)]) / 6 / PARTS).ravel()
        points = self._on(wall, inside)
        size = Norm(specialcf.JacobianMatrix(2, 1))(points).ravel() / (2 * PARTS)
        places = self.position(self._on(wall, ends))[:, 0].reshape(-1, PARTS + 1)
        density = GridFunction(scalar)
        along = []
        for component, unknown in zip(forces.components[0].components, (sheared, on_wall)):
            density.vec[:] = 0
            if unknown.NumSet():
                density.vec.data = mass.mat.Inverse(unknown, inverse="umfpack") * component.vec
            along.append((density(points).ravel() * size).reshape(-1, PARTS, 2).sum(axis=2))
        backwards = places[:, 0] > places[:, -1]
        for values in (places, *along):
            values[backwards] = values[backwards, ::-1]
        order = np.argsort(places[:, 0])
        shear, across = (values[order].ravel() for values in along)
        return Surface(np.append(places[order, :-1], places.max()), across if wall == "top" else -across, shear)

    def _on(self, part: str, places: np.ndarray) -> np.ndarray:
        """Points at some places in [0, 1] of each edge of a part of the boundary."""
        rule = IntegrationRule([(place,) for place in places], [0.0] * len(places))
        return self.mesh.MapToAllElements({SEGM: rule}, self.mesh.Boundaries(part))

    def _points(self, order: int) -> tuple[np.ndarray, ...]:
        """Places (n, 2) um of quadrature points, their areas (n,) and stresses (n, 4) xx, yy, zz, xy."""
        rule = IntegrationRule(TRIG, order)
        points = self.mesh.MapToAllElements({TRIG: rule}, VOL)
        size = (Det(specialcf.JacobianMatrix(2)) * Det(Grad(self.position)))(points).ravel()
        stress = self.cauchy(points)
        return (self.position(points), size * np.tile(rule.weights, len(points) // len(rule.weights)),
                np.column_stack([stress[:, 0], stress[:, 3], self.across(points).ravel(), stress[:, 1]]))

    def tensile_stress(self) -> tuple[float, list[float]]:
        """The largest principal value of the mean stress around a point, and the point (um)."""
        inside, *_ = data = self._points(4)
        candidates = np.vstack([inside, *(self.shape(part) for part in ("bottom", "axis", "free", "top"))])
        coarse = _largest_principal(candidates, *data)
        candidates = candidates[np.argsort(coarse)[-CANDIDATES:]]
        fine = _largest_principal(candidates, *self._points(QUADRATURE))
        return float(fine.max()), candidates[fine.argmax()].tolist()


def _largest_principal(centres: np.ndarray, places: np.ndarray, areas: np.ndarray, stress: np.ndarray) -> np.ndarray:
    """(c,) largest principal values of the mean stresses around centres (c, 2) um."""
    reach = LENGTH * WIDTH
    places, areas, stress = (np.concatenate([values, values * mirrored]) for values, mirrored in
                             ((places, [-1, 1]), (areas, 1), (stress, [1, 1, 1, -1])))
    values = np.empty(len(centres))
    for chosen in np.array_split(np.argsort(centres[:, 0]), math.ceil(len(centres) / 100)):
        centre = centres[chosen]
        near = ((places > centre.min(axis=0) - reach) & (places < centre.max(axis=0) + reach)).all(axis=1)
        distance = ((centre[:, None] - places[near]) ** 2).sum(axis=2)
        weights = np.maximum(1 - distance / reach**2, 0) * areas[near]
        total = np.maximum(weights.sum(axis=1), np.finfo(float).tiny)
        xx, yy, zz, xy = (weights @ stress[near] / total[:, None]).T
        largest = np.maximum((xx + yy) / 2 + np.hypot((xx - yy) / 2, xy), zz)
        values[chosen] = np.where(total > areas.min(), largest, -np.inf)
    return values


def _geometry(radius: float, size: float, line: float | None, smallest: float) -> OCCGeometry:
    """A quarter of a disc. Its sides are "bottom", "axis", "free", and "top" above the contact line."""
    def at(angle: float) -> Pnt:
        return Pnt(radius * math.cos(angle), radius * math.sin(angle), 0)

    angles = [0, math.pi / 2] if line is None else [0, line, math.pi / 2]
    arcs = [ArcOfCircle(at(first), at((first + last) / 2), at(last)) for first, last in zip(angles, angles[1:])]
    face = Face(Wire([Segment(Pnt(0, 0, 0), at(0)), *arcs, Segment(at(math.pi / 2), Pnt(0, 0, 0))]))
    face.maxh = size * radius
    for edge in face.edges:
        middle = edge.center
        if middle.y < 1e-9 * radius:
            edge.name = "bottom"
        elif middle.x < 1e-9 * radius:
            edge.name = "axis"
        else:
            edge.name = "free" if line is None or math.atan2(middle.y, middle.x) < line else "top"
    singular = at(0 if line is None else line)
    for vertex in face.vertices:
        if math.dist((vertex.p.x, vertex.p.y), (singular.x, singular.y)) < 1e-9:
            vertex.maxh = smallest * size / SIZE * radius
    return OCCGeometry(face, dim=2)


def touching(theta: float, size: float, guess: float, rule: Rule) -> tuple[dict[str, float], float]:
    """The numbers of the seed that grows into the upper wall, or into a plane, and the angle of its contact line.

    guess: of this angle.
    """
    body, trials = None, []
    while not trials or abs(trials[-1][1]) > CLOSE:
        if len(trials) < 2:
            angle = guess + len(trials) * LONGEST_TURN / 4
        else:
            (before, was), (last, now) = trials[-2:]
            angle = last + min(max(-now * (last - before) / (now - was), -LONGEST_TURN), LONGEST_TURN)
        if body is None or abs(angle - body.first) > 2 * LONGEST_TURN:
            body = Body(SEED, theta, size, angle)
        body.turn(angle)
        trials.append((angle, body.clearance(rule)[0]))
    top = body.shape("top")[:, 0]
    tensile, place = body.tensile_stress()
    traction, middle = max(body.surface(wall).largest_mean() for wall in ("bottom", "top"))
    return {"length_um": 2 * top.max(), "tip_um": body.shape("free")[:, 0].max(), "wall_traction": traction,
            "tensile_stress": tensile, "binds_um": body.clearance(rule)[1], "traction_x_um": abs(middle),
            "tensile_x_um": place[0], "tensile_y_um": place[1], "unknowns": body.space.ndof}, trials[-1][0]


def bonded(radius: float, theta: float, size: float) -> dict[str, float]:
    """The numbers of a half-disc whose points on the lower wall do not move."""
    body = Body(radius, theta, size, bonded=True)
    tensile, place = body.tensile_stress()
    traction, middle = body.surface("bottom").largest_mean()
    return {"thickness_um": body.shape("axis")[:, 1].max(), "tip_um": body.shape("free")[:, 0].max(),
            "wall_traction": traction, "tensile_stress": tensile, "traction_x_um": abs(middle),
            "tensile_x_um": place[0], "tensile_y_um": place[1], "unknowns": body.space.ndof}


def judged(coarse: dict[str, float], fine: dict[str, float]) -> dict[str, dict[str, float]]:
    """Numbers of the finer mesh, with bars."""
    return {name: {"value": float(value), "bar": float(abs(value - coarse[name]))} if name in BARRED else float(value)
            for name, value in fine.items()}


def main() -> None:
    """Write the numbers and the bars of every state."""
    numbers: dict[str, list] = {"touching": [], "bonded": [], "welded": []}
    for kind, states, rule in (("touching", TOUCHING, AT_WALL), ("welded", WELDED, AT_PLANE)):
        for theta, guess in states.items():
            coarse, angle = touching(theta, SIZE, guess, rule)
            fine, _ = touching(theta, SIZE / 2, angle, rule)
            if kind == "welded":
                # A plane bears nothing; the traction of the lower wall alone would be another number.
                fine = {name: value for name, value in fine.items() if "traction" not in name}
            numbers[kind].append({"radius_um": SEED, "width_um": WIDTH, "theta": theta, **judged(coarse, fine)})
            print(json.dumps(numbers[kind][-1]), flush=True)
    for radius, theta in BONDED:
        fine = judged(bonded(radius, theta, SIZE), bonded(radius, theta, SIZE / 2))
        numbers["bonded"].append({"radius_um": radius, "width_um": WIDTH, "theta": theta, **fine})
        print(json.dumps(numbers["bonded"][-1]), flush=True)
    (FOLDER / "growth.json").write_text(json.dumps(numbers, indent=1) + "\n")


if __name__ == "__main__":
    main()
