"""The paper's own geometries against scikit-fem's Taylor-Hood elements on curved meshes of their own: whole fields,
both codes refined together.

Taylor-Hood's pressure may jump at the interface; its errors are of third order and far below ours, so that differences
fall at our orders. Two singularities limit them. The pressure jumps at the interface and ours cannot: order 1/2 for the
pressure beside it, which is that of the biomass while it is stiff. At the three-phase corner the biomass is held by the
wall and pushed by the water. In the traction form its pressure is like r^-0.41 there (cos(z pi / 2) = z, stress like
r^(z - 1)), which would allow order 0.59; in the Laplacian form it is bounded; tests of the reference measure both. So
the jump is the harder limit. Its share in the velocity and in the head loss is of first order, and seen at lambda = 10
alone: a stiff body takes it all.

The head loss has an error of first order besides, of both ends (see :mod:`verification.flow.closed_forms`). It is that
of the clean channel on the same mesh, so that the excess over that loss is free of it.

On curved triangles of order 2 and 3 the jump is all that is left: 1/2 in energy, which is twice that in the loss, and
in L2 of the velocity by duality.

Linear velocities with a condensed bubble (MINI): the same as without condensing, and what it is worth.

With c = 100 the stabilised element's tau = h^2 / (100 nu) is within 7 % of the bubble's, h^2 / (106.7 nu), for
equilateral triangles: on good meshes both err alike. The bubble has no constant to choose, and on stretched triangles,
where the circumscribed circle says little, it errs far less.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.sparse import bmat
from scipy.sparse.linalg import spsolve
from skfem import Basis, BilinearForm, ElementTriMini, ElementTriP1, ElementVector
from skfem.helpers import ddot, div, grad, transpose

from reference import layered_channel, poiseuille, taylor_hood
from repro.fem.mesh import Mesh
from repro.fem.space import Space
from repro.model import flow, pore
from repro.scene import parse_scene
from verification.flow import closed_forms, properties
from verification.kernel.case import Check, Outcome, Profile, Study, at_least, at_most, between, case, refine, study
from verification.problems import meshes, norms
from verification.problems.norms import sampled

WIDTH, ENDS, RATIO, CORNER = 50.0, (-75.0, 75.0), 2000.0, 4
LEVELS = range(4)
#: Refinement of our mesh on each level, where Taylor-Hood's is halved again, and how many meshes are drawn (see
#: grids.SPREAD).
REFINEMENTS, DRAWS = (0.65, 1.3, 2.6, 5.2), (3, 3, 3, 1)
FILM_REFINEMENTS, FILM_DRAWS = (0.9, 1.8, 3.6, 7.2), (3, 3, 2, 1)
#: Radius of the half-disc that leaves a film (um), and the refinement of its curved mesh.
FILM, FILM_CURVED = 41.0, 1.6
HIGHER = [(order, interface) for order in (2, 3) for interface in ("laplacian", "traction")]
NORM = ("root mean square over meshes of a size: L2 of the difference over that of Taylor-Hood's field, in the region; "
        "relative difference of the head loss")
SECOND = "linear elements: second order in L2"
JUMP = "1/2: the pressure jumps at the interface, a continuous one cannot"
INSIDE = "2 inside, 3/2 by the layers of one element at both ends, 1 in the end"
ENDS_FIRST = "first order: the stabilisation's own condition dp/dn = 0 at both ends spoils one layer of elements"
EXCESS = "second order: what the ends spoil is in both losses"


@case("flow-half-disc", kind="cross-code", norm=NORM, slow=True,
      claim="Around half-discs of 5 and 25 um, lambda = 2000, velocity, pressure and head loss are Taylor-Hood's",
      mutants=("viscosity-swapped",), ways="1", because="orders 2, 3: flow-curved-half-disc")
def half_disc() -> Outcome:
    seed, grown = (_series(radius, RATIO, "laplacian") for radius in (5.0, 25.0))
    studies = (*_studies(seed, "R = 5 um"), *_studies(grown, "R = 25 um"), _excess(grown, "R = 25 um"),
               study("head loss, R = 5 um", seed["size"], seed["loss"], 1, ENDS_FIRST, ceiling=4e-3))
    checks = (at_most("excess of the head loss, R = 5 um", seed["excess"][-1], 2e-4,
                      "a fifth of 0.1 %; the grading of the mesh (see _film_size) leaves no order to judge"),)
    return Outcome(checks, studies, _profiles(25.0, RATIO, "laplacian"))


@case("flow-film", kind="cross-code", norm=NORM, slow=True,
      claim="Through the film of 9 um that a half-disc of 41 um leaves open, lambda = 2000, the flow is Taylor-Hood's, "
            "with elements of every order",
      mutants=("viscosity-swapped",), ways="1 2 3")
def film() -> Outcome:
    """No order: elements grow from the walls of the film to its middle, whatever the refinement, so that no one size
    tells how fine a mesh is there."""
    errors = _series(FILM, RATIO, "laplacian", FILM_REFINEMENTS, FILM_DRAWS)
    checks = []
    for name, key in (("velocity", "velocity"), ("pressure in the fluid", "fluid"), ("head loss", "loss")):
        steps = errors[key][1:] / errors[key][:-1]
        checks += [at_most(f"{name}, finest meshes", errors[key][-1], 1e-3, "0.1 % (cross-code)"),
                   at_most(f"{name}, largest ratio of neighbours", steps.max(), 0.6,
                           "both codes refined twofold: half is of first order, the film's elements are refined later")]
        checks += [at_most(f"{name}, order {order}, {interface}", _through_the_film(order, interface)[key], 1e-3,
                           "0.1 % (cross-code)") for order, interface in HIGHER]
    return Outcome(tuple(checks), (), _profiles(FILM, RATIO, "laplacian"))


@cache
def _through_the_film(order: int, interface: str) -> dict[str, float]:
    """Differences of higher orders on one curved mesh."""
    space = Space(meshes.half_disc(FILM, FILM_CURVED, ENDS, WIDTH, geometry=2), order)
    theirs = _trusted(FILM, RATIO, interface, LEVELS[-1])
    found = flow.unit_flow(space, RATIO, interface=interface)
    fluid = next(part for part in theirs.pressures if not part.biomass)
    heads = norms.field_at(flow.pressure_space(space), found.pressure, fluid.points)
    return {"velocity": _relative(norms.field_at(space, found.velocity, theirs.points), theirs.velocity, theirs.areas),
            "fluid": _relative(heads[:, None], fluid.values[:, None], fluid.areas),
            "loss": abs(found.loss / theirs.loss - 1)}


@case("flow-half-disc-traction", kind="cross-code", norm=NORM, slow=True,
      claim="With continuous traction too the flow around a half-disc of 25 um is Taylor-Hood's, lambda = 10 and 2000",
      mutants=("traction-transposed",), ways="1", because="orders 2, 3: flow-curved-half-disc")
def half_disc_traction() -> Outcome:
    stiff, soft = (_series(25.0, ratio, "traction") for ratio in (RATIO, 10.0))
    studies = (*_studies(stiff, "lambda = 2000"), _excess(stiff, "lambda = 2000"),
               study("velocity, lambda = 10", soft["size"], soft["velocity"], 2, SECOND, ceiling=7e-4),
               study("pressure in the biomass, lambda = 10", soft["size"], soft["biomass"], 0.5, JUMP, ceiling=0.1))
    checks = (at_most("excess of the head loss, lambda = 10", soft["excess"][-1], 1e-3,
                      "the jump's share, first order and negative, meets the rest, second order and positive"),
              at_most("pressure in the fluid, lambda = 10", soft["fluid"][-1], 3e-3,
                      "the jump's share: biomass that gives way leaves half of it to the fluid, order 1/2 in the end"))
    return Outcome(checks, studies, _profiles(25.0, 10.0, "traction"))


QUADRATIC, QUADRATIC_DRAWS = (0.3, 0.6, 1.2, 2.4), (3, 3, 3, 1)


@case("flow-half-disc-quadratic", kind="cross-code", norm=NORM,
      claim="The same forms with quadratic and cubic velocities on straight triangles give Taylor-Hood's head loss to "
            "0.1 %",
      mutants=("quadratic-stabilised",), ways="2 3", because="order 1: flow-half-disc")
def half_disc_quadratic() -> Outcome:
    studies = []
    for order in (2, 3):
        errors = refine(_chords, LEVELS, order)
        studies.append(study(f"head loss, order {order}", errors["size"], errors["loss"], 2,
                             "the chords of the arc: second order", ceiling=1e-3))
    return Outcome(studies=tuple(studies))


def _chords(level: int, order: int) -> dict[str, float]:
    """Difference of the head loss on straight triangles."""
    trusted = _trusted(25.0, RATIO, "laplacian", 2).loss

    def apart(draw: int):
        grid = _grid(25.0, QUADRATIC[level] * meshes.SPREAD[draw])
        found = flow.unit_flow(Space(grid, order), RATIO)
        return {"size": norms.mean_size(grid), "loss": abs(found.loss / trusted - 1)}

    return meshes.root_mean_square(apart, QUADRATIC_DRAWS[level])


def _series(radius: float, ratio: float, interface: str, refinements=REFINEMENTS, draws=DRAWS) -> dict[str, np.ndarray]:
    """Differences on all levels."""
    def measure(level: int):
        def apart(draw: int):
            return _apart(radius, ratio, interface, level, refinements[level] * meshes.SPREAD[draw])
        return meshes.root_mean_square(apart, draws[level])

    return refine(measure, LEVELS)


def _studies(errors: dict[str, np.ndarray], where: str) -> tuple[Study, ...]:
    size = errors["size"]
    return (study(f"velocity, {where}", size, errors["velocity"], 2, SECOND, ceiling=8e-4),
            Study(f"pressure in the fluid, {where}", size, errors["fluid"], 1.2, 2.2, INSIDE, 1e-3),
            study(f"pressure in the biomass, {where}", size, errors["biomass"], 0.5, JUMP, ceiling=0.2))


def _excess(errors: dict[str, np.ndarray], where: str) -> Study:
    return study(f"excess of the head loss, {where}", errors["size"], errors["excess"], 2, EXCESS, ceiling=1e-3)


@cache
def _trusted(radius: float, ratio: float, interface: str, level: int) -> taylor_hood.Stokes:
    return taylor_hood.stokes(taylor_hood.half_disc(WIDTH, ENDS, radius, level, CORNER), ratio, interface)


@cache
def _grid(radius: float, refinement: float) -> Mesh:
    return meshes.half_disc(radius, refinement, ENDS, WIDTH)


def _apart(radius: float, ratio: float, interface: str, level: int, refinement: float) -> dict[str, float]:
    """Differences of our flow from Taylor-Hood's at the middles of its edges, weighed by their areas."""
    grid, theirs = _grid(radius, refinement), _trusted(radius, ratio, interface, level)
    found, clean = (flow.unit_flow(Space(grid, 1), each, interface=interface) for each in (ratio, 1.0))
    ends = clean.loss - poiseuille.head_loss(ENDS[1] - ENDS[0], WIDTH, 1.0, 1.0)
    apart = {"size": norms.mean_size(grid), "loss": abs(found.loss / theirs.loss - 1),
             "excess": abs((found.loss - ends) / theirs.loss - 1),
             "velocity": _relative(sampled(grid, found.velocity, theirs.points), theirs.velocity, theirs.areas)}
    for part in theirs.pressures:
        apart["biomass" if part.biomass else "fluid"] = _relative(
            sampled(grid, found.pressure, part.points)[:, None], part.values[:, None], part.areas)
    return apart


def _relative(ours, theirs, areas) -> float:
    """Weighed root of the sum of squares of the difference of fields (K, m), over that of theirs."""
    return float(np.sqrt(areas @ np.sum((ours - theirs) ** 2, axis=1) / (areas @ np.sum(theirs**2, axis=1))))


def _profiles(radius: float, ratio: float, interface: str) -> tuple[Profile, ...]:
    """u_x on the line x = 0, and the fluid's pressure along the upper wall: ours on the second level, the finest of
    theirs."""
    grid, theirs = _grid(radius, REFINEMENTS[1]), _trusted(radius, ratio, interface, LEVELS[-1])
    found = flow.unit_flow(Space(grid, 1), ratio, interface=interface)
    fluid = next(part for part in theirs.pressures if not part.biomass)
    across, along = np.abs(theirs.points[:, 0]) < 1e-6, fluid.points[:, 1] > WIDTH * (1 - 1e-9)
    title = f"R = {radius:g} um, lambda = {ratio:g}, {interface}"
    return (_profile(title, "y at x = 0 (um)", "u_x / u_ave", theirs.points[across], 1, theirs.velocity[across, 0],
                     sampled(grid, found.velocity[:, 0], theirs.points[across])),
            _profile(title, "x along the upper wall (um)", "p g / (nu u_ave) (1/um)", fluid.points[along], 0,
                     fluid.values[along], sampled(grid, found.pressure, fluid.points[along])))


def _profile(title: str, x_label: str, y_label: str, where, axis: int, theirs, ours) -> Profile:
    order = np.argsort(where[:, axis])
    x = where[order, axis]
    return Profile(title, x_label, y_label, (("ours", "ours", x, ours[order]),
                                             ("Taylor-Hood", "reference", x, theirs[order])))


#: Radius of the half-disc (um) on curved triangles, and refinements of its mesh: on coarser ones what is smooth, of
#: third order, still counts (orders of 1.5 in the velocity, 0.5 in the loss, where it has the other sign).
ROUND, ROUND_REFINEMENTS, ROUND_DRAWS = 20.0, (0.85, 1.3, 2.0, 3.0), (3, 3, 3, 1)
#: Refinements where lambda = 2000, with the most that they may differ by.
STIFF = {0.6: 1e-3, 2.4: 1e-4}
ROUND_JUMP = "the pressure jumps at the interface [E2], ours is continuous: 1/2 in energy, twice that in the loss"
#: Largest last error of the loss and of the velocity: the traction form pushes harder on biomass that gives way.
SOFT = {"laplacian": 5e-4, "traction": 1.5e-3}


@case("flow-curved-half-disc", kind="cross-code", slow=True,
      norm="velocity at the corners of the reference's triangles, root mean square, and the loss, relative",
      claim="Around a half-disc of biomass the whole velocity field and the loss are scikit-fem's, which has a "
            "pressure of its own on either side: to first order for lambda = 10, under 0.1 % for lambda = 2000, with "
            "elements of order 2 and 3 in both forms",
      mutants=("viscosity-swapped", "curved-straight-divergence"),
      ways="2 3", because="order 1: flow-half-disc, flow-half-disc-traction")
def round_half_disc() -> Outcome:
    return Outcome(tuple(check for part in HIGHER for check in _stiff(*part)),
                   tuple(found for part in HIGHER for found in _soft(*part)), (_above_the_middle(),))


def _soft(order: int, interface: str) -> tuple[Study, Study]:
    """Orders where the biomass gives way."""
    errors = refine(_round_means, LEVELS, order, interface)
    name, ceiling = f"lambda = 10, order {order}, {interface}", SOFT[interface]
    return (study(f"loss, {name}", errors["size"], errors["loss"], 1, ROUND_JUMP, ceiling=ceiling),
            Study(f"velocity, {name}", errors["size"], errors["velocity"], 0.7, 1.3 if order == 2 else 1.6,
                  ROUND_JUMP + ", and in L2 by duality; of order 3 down from 4", ceiling))


def _round_means(level: int, order: int, interface: str) -> dict[str, float]:
    return meshes.root_mean_square(
        lambda draw: _round_errors(ROUND_REFINEMENTS[level] * meshes.SPREAD[draw], 10.0, order, interface),
        ROUND_DRAWS[level])


def _stiff(order: int, interface: str) -> list[Check]:
    """Differences where it all but stands still."""
    told = "0.1 %, as between codes; biomass all but stands still, and its pressure hardly matters"
    checks = []
    for refinement, bound in STIFF.items():
        row = _round_errors(refinement, RATIO, order, interface)
        checks += [at_most(f"{name}, lambda = 2000, order {order}, {interface}, refinement {refinement:g}", row[name],
                           bound, told) for name in ("velocity", "loss")]
    return checks


@cache
def _round(refinement: float) -> Mesh:
    """The mesh of a scene."""
    tables = {"pore": {"width": f"{WIDTH} um"}, "aggregate": {"radius": f"{ROUND} um"}, "flow": {"head": "1e-3 cm"},
              "numerics": {"preset": "accurate", "refinement": refinement}}
    return pore.seeded(parse_scene(tables, "half disc", "half_disc.toml")).mesh


@cache
def _round_trusted(ratio: float, interface: str) -> taylor_hood.Stokes:
    return taylor_hood.stokes(taylor_hood.half_disc(WIDTH, _round(1.0).ends, ROUND, 2), ratio, interface)


def _round_errors(refinement: float, ratio: float, order: int, interface: str) -> dict[str, float]:
    """Over the whole field, weighted by areas, and of the loss."""
    space, trusted = Space(_round(refinement), order), _round_trusted(ratio, interface)
    found = flow.unit_flow(space, ratio, interface=interface)
    return {"size": 1 / np.sqrt(len(space.cells)), "loss": abs(found.loss / trusted.loss - 1),
            "velocity": _relative(norms.field_at(space, found.velocity, trusted.points), trusted.velocity,
                                  trusted.areas)}


def _above_the_middle() -> Profile:
    space, trusted = Space(_round(0.6), 2), _round_trusted(RATIO, "laplacian")
    line = np.abs(trusted.points[:, 0]) < 1e-6
    ours = norms.field_at(space, flow.unit_flow(space, RATIO).velocity, trusted.points[line])[:, 0]
    return _profile("above the middle, order 2, lambda = 2000", "y (um)", "u_x / u_ave", trusted.points[line], 1,
                    trusted.velocity[line, 0], ours)


BUBBLE_DRAWS = (8, 6, 3, 1)
STABILISED, BUBBLE = flow.Stabilised(), flow.Bubble()


@BilinearForm
def laplacian(u, v, w):
    """(k grad u, grad v)."""
    return w["k"] * ddot(grad(u), grad(v))


@BilinearForm
def symmetric(u, v, w):
    """(k (grad u + grad u^T), grad v)."""
    return w["k"] * ddot(grad(u) + transpose(grad(u)), grad(v))


@BilinearForm
def continuity(u, q, w):
    """(q, div u)."""
    return q * div(u)


def uncondensed(grid: Mesh, ratio: float, form, interface: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Velocity (N, 2) at the nodes, mean velocity (T, 2), bubble included, and pressure (N,) of scikit-fem's MINI
    element, bubbles kept as unknowns, under the conditions (3)-(5)."""
    basis = Basis(grid.fem, ElementVector(ElementTriMini()), intorder=4)
    basis_p = basis.with_element(ElementTriP1())
    k = np.where(grid.biomass, ratio, 1.0)[:, None] * np.ones(basis.dx.shape)
    B = -continuity.assemble(basis, basis_p)
    system = bmat([[form.assemble(basis, k=k), B.T], [B, None]]).tocsc()
    value, held = np.zeros(system.shape[0]), np.zeros(system.shape[0], bool)
    x, y = grid.points.T
    nodes = basis.nodal_dofs
    rim = (y == 0) | (y == grid.width) | (x == grid.ends[0])
    held[nodes[:, rim].ravel()] = True
    held[nodes[1, (x == grid.ends[1]) & (interface == "traction")]] = True
    inlet = grid.topology.inlet
    profile = y[inlet] * (grid.width - y[inlet])
    value[nodes[0, inlet]] = profile * grid.width / np.trapezoid(profile, y[inlet])
    value[~held] = spsolve(system[~held][:, ~held], -(system[~held][:, held] @ value[held]))
    velocity, bubbles = value[nodes].T, value[basis.interior_dofs].T
    mean = velocity[grid.triangles].mean(axis=1) + 9 / 20 * bubbles
    return velocity, mean, value[basis.N:]


@case("flow-bubble", kind="cross-code",
      norm="largest difference over the largest value; largest relative error of the flux through 25 sections",
      claim="The condensed bubble is scikit-fem's MINI element with its bubbles as unknowns, in both forms, and the "
            "mean velocity of each triangle, bubble included, carries the same flux through every section",
      mutants=("bubble-of-water", "bubble-mean-unweighted", "bubble-block-isotropic"),
      ways="1", because="the bubble is of linear velocities")
def condensed() -> Outcome:
    grid = meshes.cut(properties.ENDS, 50.0, 6.0, lambda x, y: (np.abs(x) < 20) & (y < 25), across=(-20.0, 20.0),
                         along=(25.0,), seed=5)
    checks = []
    for interface, form in (("laplacian", laplacian), ("traction", symmetric)):
        velocity, mean, pressure = uncondensed(grid, RATIO, form, interface)
        ours = flow.unit_flow(Space(grid, 1), RATIO, interface=interface, element=flow.Bubble())
        carried = ours.velocity[grid.triangles].mean(axis=1) - ours.correction
        why = "the same equations: round-off of a system whose viscosities differ by 2000"
        pairs = {"velocity": (ours.velocity, velocity), "pressure": (ours.pressure, pressure),
                 "mean velocity": (carried, mean)}
        checks += [at_most(f"{name}, {interface}", np.abs(found - other).max() / np.abs(other).max(), 1e-9, why)
                   for name, (found, other) in pairs.items()]
        checks.append(at_most(f"flux of the mean velocity, {interface}", properties.flux_error(grid, carried), 1e-9,
                              "(2) tested with linear ramps, round-off"))
    return Outcome(tuple(checks))


@case("flow-bubble-layers", kind="exact",
      norm="middle of a long layer, lambda = 2000, root mean square over random meshes of a size: L2 of u, of grad u, "
           "and relative error of the pressure gradient; errors of the stabilised element over the bubble's",
      claim="The bubble is of second order in velocity and loss and of first in the gradient; it errs as the "
            "stabilised element with c = 100 does on good triangles, many times less on triangles stretched eightfold",
      mutants=("bubble-of-water", "bubble-tenfold"), ways="1", because="the bubble is of linear velocities")
def along_a_layer() -> Outcome:
    errors = refine(_errors, range(len(closed_forms.SIZES)), BUBBLE)
    stabilised = refine(_errors, range(len(closed_forms.SIZES)), STABILISED)
    studies = (study("velocity", closed_forms.SIZES, errors["velocity"], 2, closed_forms.SECOND, ceiling=1e-3),
               study("pressure gradient", closed_forms.SIZES, errors["gradient"], 2, closed_forms.SECOND,
                     ceiling=1.2e-3),
               study("velocity's gradient", closed_forms.SIZES, errors["slope"], 1,
                     "linear elements: first order in H1", ceiling=0.1))
    ratio = stabilised["velocity"] / errors["velocity"]
    stretched = [_stretched(1, draw, element)["velocity"] for element in (STABILISED, BUBBLE) for draw in range(3)]
    why = "tau is the same to 7 % where triangles are equilateral"
    return Outcome((between("stabilised over bubble, least", ratio.min(), 0.9, 1.1, why),
                    between("stabilised over bubble, largest", ratio.max(), 0.9, 1.1, why),
                    at_least("stabilised over bubble, stretched", np.mean(stretched[:3]) / np.mean(stretched[3:]), 10.0,
                             "tau goes as the square of the longest side, the bubble's as that of the shortest: up to "
                             "the square of the stretch, 64")), studies)


def _errors(level: int, element: flow.Stabilised | flow.Bubble) -> dict[str, float]:
    return meshes.root_mean_square(lambda draw: _layered(closed_forms._grid(level, draw), element, closed_forms.MIDDLE),
                                  BUBBLE_DRAWS[level])


def _layered(grid: Mesh, element: flow.Stabilised | flow.Bubble, half: float) -> dict[str, float]:
    """Relative errors for |x| < half (um)."""
    found = flow.unit_flow(Space(grid, 1), RATIO, element=element)
    middle = np.abs(grid.points[grid.triangles, 0].mean(axis=1)) < half
    gradient = layered_channel.gradient(closed_forms.WIDTH, closed_forms.LAYER, RATIO)
    return {"velocity": norms.l2_error(grid.points, grid.triangles[middle], found.velocity, _exact),
            "gradient": abs(closed_forms.slope(Space(grid, 1), found.pressure, middle) / gradient - 1),
            "slope": _slope_error(grid, found.velocity[:, 0], half)}


def _exact(x, y):
    return np.stack([layered_channel.velocity(y, closed_forms.WIDTH, closed_forms.LAYER, RATIO), 0 * y], axis=-1)


def _slope_error(grid: Mesh, speed: np.ndarray, half: float) -> float:
    """Relative L2 error of grad u_x for |x| < half, exact slopes by differences of the exact velocity."""
    chosen = np.abs(grid.points[grid.triangles, 0].mean(axis=1)) < half
    where, weight, _ = norms.quadrature(grid.points, grid.triangles[chosen])
    ours = np.einsum("tai,ta->ti", grid.gradients[chosen], speed[grid.triangles[chosen]])
    y, step = where[..., 1], 1e-4
    exact = (_exact(0 * y, y + step) - _exact(0 * y, y - step))[..., 0] / (2 * step)
    apart = ours[:, None, 0] ** 2 + (ours[:, None, 1] - exact) ** 2
    return float(np.sqrt(np.sum(weight * apart) / np.sum(weight * exact**2)))


STRETCH = 8.0


@cache
def _long_triangles(level: int, draw: int) -> Mesh:
    """A mesh of a layer whose triangles are STRETCH times longer than high."""
    end = closed_forms.LAYER_END / STRETCH
    rim = end + closed_forms.SIZES[level]
    short = meshes.cut((-rim, rim), closed_forms.WIDTH, closed_forms.SIZES[level], lambda x, y: (y < closed_forms.LAYER)
                          & (np.abs(x) < end), across=(-end, end), along=(closed_forms.LAYER,), seed=7 * level + draw)
    return Mesh.of(short.points * [STRETCH, 1.0], short.cells, short.biomass, short.loop, short.width,
                   (-STRETCH * rim, STRETCH * rim))


def _stretched(level: int, draw: int, element: flow.Stabilised | flow.Bubble) -> dict[str, float]:
    return _layered(_long_triangles(level, draw), element, 60.0)
