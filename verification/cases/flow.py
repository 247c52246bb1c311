"""Flow with a known solution: through channels, along layers, past a disc, and manufactured.

Plane Poiseuille flow in a clean channel, and through a plug, which keeps the profile in the Laplacian form. The
stabilisation imposes dp/dn = 0 at inlet and outlet, which spoils one layer of elements. Linear velocities are of second
order, but the head loss (6), the difference of the mean pressures *at* both ends, is of first order. Quadratic
elements contain a parabola and a linear head, so they are exact.

A layer of biomass along the lower wall of a long channel: two viscous layers, exact for any ratio of viscosities. The
parabola of the inlet turns into the layered profile over a few thicknesses (like exp(-1.1 x / h) in biomass). The
middle of the layer is ten thicknesses from its ends, where the remainder is under 1e-4. Both forms of [E2] have the
same shear between the layers. In the traction form the layer is fixed below and free above, and the effect of its ends
decays more slowly, like exp(-z x / h) with cos z = z, z = 0.739. Quadratic elements contain both parabolas. On a
coarse mesh of a longer layer this remainder is their only error.

A permeable layer has Brinkman's drag instead of a viscosity, exact for any drag. Its boundary layers are sqrt(k) thick.
If elements resolve them, errors fall with the order of the elements. Much thinner ones (0.03 um for 1e-15 m2) are not
resolved: the layer is nearly a wall, and the water beside it depends on the pressure gradient alone.

A viscous disc in a sheared fluid: Schmid & Podladchikov's closed form, and its twin in the Laplacian form of [E2]. The
pressure jumps at the interface by as much as it varies. The continuous pressure of (3.2) smears the jump over one layer
of elements: an error of order one over an area of order h, or order 1/2 in L2 with any elements. Its effect on the
velocity is of first order (the square, by duality). Quadratic elements show it at lambda = 10. On these meshes it is
small beside the second-order error of linear elements, and at lambda = 2000, where the disc is stiff. There curved
elements, whose disc is round, keep their orders until the share of the jump is larger.

Manufactured flow through a straight interface: only the viscosity jumps, so no order is reduced. The force of the
strong form (1) acts in both phases. The stabilisation of linear elements ignores it, as in (3.2), which has no force;
it stays consistent to second order. On bent triangles the map (s, t) -> (s, t + BEND s^2) keeps the interface straight.
"""

from collections.abc import Callable
from functools import cache
from types import ModuleType

import numpy as np
import pytest

from reference import brinkman_channel, layered_channel, manufactured_flow, poiseuille, viscous_inclusion
from repro.fem import mesher
from repro.fem.mesh import Mesh, curved
from repro.fem.sizing import Sizing
from repro.fem.space import Space
from repro.fem.walls import channel_walls
from repro.model import flow
from repro.model.brinkman import ACROSS
from repro.model.interface import interface_of
from repro.model.resistance import Permeable, Viscous
from repro.scene import Flow as Drive
from verification.evidence.cases import combined, parametrize
from verification.evidence.checks import around, at_least, at_most, each_at_most, refine, studies
from verification.problems import meshes
from verification.problems.channels import box_errors

WIDTH = 50.0
ENDS = (-75.0, 75.0)
RATIO = 2000.0
#: Axes of the variants: both forms of [E2], orders of the elements, and (by :func:`viscous`) ratios of viscosities.
FORMS = {form: form for form in ("laplacian", "traction")}
ORDERS = {f"order {order}": order for order in (1, 2)}
QUADRATIC = {"order 2": 2}
#: Length of the whole pore (um), nu / g (um h) and mean velocity (um/h) in the cases that need them.
LENGTH, VISCOSITY, MEAN = 600.0, 3e-4, 2.0
SECOND = "linear elements: second order in L2"
ENDS_FIRST = "first order: the stabilisation's own condition dp/dn = 0 at both ends spoils one layer of elements"
ROUND_OFF = "round-off: the elements contain a parabola and a linear head"


def viscous(*ratios: float) -> dict[str, float]:
    """Ratios lambda of the viscosities, by label."""
    return {f"lambda = {ratio:g}": ratio for ratio in ratios}


def drive(**values) -> Drive:
    """A drive of a scene: a head (um) or a mean velocity (um/h)."""
    return Drive(kinematic_viscosity=VISCOSITY, gravity=1.0, **values)


@pytest.mark.case(
    "flow-poiseuille", kind="exact",
    mutants=("saddle-sign", "tau-linear", "upper-wall-slips", "outlet-free", "unmeshed-forgotten"),
    references=("poiseuille",), runs_with="1", omitted="order 2: flow-curved-poiseuille")
@pytest.mark.parametrize("interface", FORMS)
def test_poiseuille(interface, record):
    """In a clean channel the flow is plane Poiseuille's, in both forms of [E2].

    Norm: L2 of u over the mesh; relative error of the head loss over it, and of the conductivity of a pore of 600 um.
    """
    record(studies(refine(_clean, (0.7, 1.25, 2.2, 3.9), interface),
                  {"velocity": (2, SECOND, 3e-4), "head loss": (1, ENDS_FIRST, 6e-3),
                   "conductivity": (1, ENDS_FIRST, 1.5e-3)}))


def _clean(refinement: float, interface: str) -> dict[str, float]:
    grid, _ = mesher.generate_around([], ENDS, Sizing(channel_walls(WIDTH), refinement, 2.0))
    return {"size": meshes.mean_size(grid), **_poiseuille_errors(Space(grid), 0.0, interface)}


def _poiseuille_errors(space: Space, half: float, interface: str = "laplacian") -> dict[str, float]:
    """Errors in a channel with a plug of a half length (um), or none. The conductivity is that of a clean pore."""
    driven = drive(mean_velocity=MEAN, viscosity_ratio=RATIO)
    solution = flow.solve(space, driven, LENGTH, interface=interface_of(interface))
    exact = poiseuille.head_loss(np.ptp(ENDS) + 2 * half * (RATIO - 1), WIDTH, MEAN, VISCOSITY)
    return {"velocity": meshes.field_error(space, solution.velocity / MEAN, _velocity),
            "head loss": abs(solution.meshed_loss / exact - 1),
            "conductivity": abs(solution.conductivity / poiseuille.conductivity(WIDTH, VISCOSITY) - 1)}


def _velocity(x, y):
    return np.stack([poiseuille.velocity(y, WIDTH), 0 * y], axis=-1)


#: Half length of the plug (um), and element sizes (um) with the number of meshes of each.
PLUG, PLUG_SIZES = 30.0, {8.0: 12, 4.0: 8, 2.0: 4, 1.0: 1}


@pytest.mark.case(
    "flow-plug", kind="exact", mutants=("tau-of-water",), references=("poiseuille",), runs_with="1",
    omitted="order 2: flow-curved-poiseuille")
def test_plug(record):
    """Through a plug the Laplacian form keeps Poiseuille's profile and loses lambda times its head there.

    Norm: root mean square over random meshes of a size: L2 of u over the mesh, relative error of the head loss.
    """
    record(studies(refine(_plug_errors, PLUG_SIZES), {
        "velocity": (2, SECOND, 5e-4),
        "head loss": (2, "second order: the plug's inside outweighs the ends", 1e-3)}))


def _plug_errors(size: float, draw: int) -> dict[str, float]:
    grid = meshes.plug(ENDS, WIDTH, PLUG, size, meshes.cut, int(100 * size) + draw)
    return _poiseuille_errors(Space(grid), PLUG)


#: Half length of the plug (um) on curved meshes, and their unequal ends.
HALF, CURVED_ENDS = 20.0, (-60.0, 70.0)
#: Ratios and forms in which the plug keeps the profile.
PARABOLAS = {f"lambda = {ratio:g}, {form}": (ratio, form)
             for ratio, form in ((1.0, "laplacian"), (1.0, "traction"), (RATIO, "laplacian"))}


@pytest.mark.case(
    "flow-curved-poiseuille", kind="exact",
    mutants=("viscosity-swapped", "loss-per-width", "inlet-parabola", "whole-pore-twice", "outlet-free",
             "quadratic-stabilised"), references=("poiseuille",), runs_with="2",
    omitted="order 1: flow-poiseuille, flow-plug")
@parametrize("ratio, interface", PARABOLAS)
def test_curved_poiseuille(ratio, interface, record):
    """With quadratic elements a clean channel, in both forms, and one with a plug of biomass of 2000 times the
    viscosity have the parabola at every node and the loss (6) of each part, on any mesh; the work of the inlet is that
    loss.

    Norm: largest difference over the largest velocity; relative difference of losses.
    """
    space = meshes.space_on(meshes.plug(CURVED_ENDS, WIDTH, HALF, 8.0, seed=3), 2)
    driven = drive(mean_velocity=MEAN, viscosity_ratio=ratio)
    solution = flow.solve(space, driven, LENGTH, interface=interface_of(interface))
    ends = space.mesh.topology
    u = poiseuille.velocity(space.points[:, 1], WIDTH, MEAN)
    plugged = 2 * HALF * (ratio - 1)  # additional length of water with the same loss
    meshed, full = (poiseuille.head_loss(length + plugged, WIDTH, MEAN, VISCOSITY)
                     for length in (np.ptp(CURVED_ENDS), LENGTH))
    heads = solution.head[ends.inlet].mean() - solution.head[ends.outlet].mean()
    errors = {"u_x": np.abs(solution.velocity[:, 0] - u).max() / u.max(),
              "u_y": np.abs(solution.velocity[:, 1]).max() / u.max(),
              "loss as work": abs(solution.meshed_loss / meshed - 1),
              "loss of the whole pore": abs(solution.head_loss / full - 1),
              "difference of heads": abs(heads / meshed - 1)}
    record(each_at_most(errors, 1e-10, ROUND_OFF))


#: Height and half length of the layer, clean water beyond its ends, and half length of the compared middle (um).
LAYER = 12.5
LAYER_END = 125.0
BEYOND = 15.0
MIDDLE = 25.0
RATIOS = viscous(1.0, 10.0, 100.0, RATIO, 1e5, 1e8)
SIZES, DRAWS = LAYER / np.array([1.5, 3.0, 6.0, 12.0]), dict(enumerate((16, 12, 6, 1)))
#: Orders of linear elements, and bounds of the errors on the finest meshes. In the traction form the remainder from the
#: ends dominates the error in the layer.
LINEAR = {"velocity": (2, SECOND, 1e-3), "velocity in the layer": (2, SECOND, 1e-3), "gradient": (2, SECOND, 1.2e-3)}
STUDIED = {"laplacian": LINEAR, "traction": {"velocity": LINEAR["velocity"]}}
#: Half length (um) of the layer for order 2, and the remainder of its ends in the middle: exp(-0.739 * 18).
LONG, REMAINDER = 250.0, 2e-6


@pytest.mark.slow
@pytest.mark.case(
    "flow-layers", kind="exact", mutants=("tau-of-water", "viscosity-swapped"), references=("layered_channel",))
@parametrize(
    "order, ratio, interface",
    {**combined({"order 1": 1}, RATIOS, {"laplacian": "laplacian"}),
     **combined({"order 1": 1}, viscous(RATIO), {"traction": "traction"}), **combined(QUADRATIC, RATIOS, FORMS)})
def test_layers(order, ratio, interface, record):
    """Along a layer of biomass the flow is that of two viscous layers, for lambda from 1 to 1e8, to second order with
    linear elements in both forms and on any mesh with quadratic ones.

    Norm: middle of a long layer, root mean square over random meshes of a size: L2 of u, of u within the layer
    (relative to that), and relative error of the pressure gradient.
    """
    if order == 1:
        record(studies(refine(_layer_errors, DRAWS, ratio, interface), STUDIED[interface]))
    else:
        errors = _viscous_layer(Space(long_layer()), ratio, interface)
        record(each_at_most(errors, REMAINDER, "remainder of the layer's ends"))


def _layer_errors(level: int, draw: int, ratio: float, interface: str) -> dict[str, float]:
    return {"size": SIZES[level], **_viscous_layer(Space(layer_grid(level, draw)), ratio, interface)}


@cache
def layer_grid(level: int, draw: int) -> Mesh:
    """One of the random meshes of straight triangles of a level of SIZES."""
    return _layered(LAYER_END, SIZES[level], draw)


@cache
def long_layer() -> Mesh:
    """A coarse mesh of six-node triangles around a longer layer."""
    return curved(_layered(LONG, SIZES[0], 0), None)


def _layered(half: float, size: float, draw: int) -> Mesh:
    """A mesh of the layer from -half to half (um), and clean water beyond."""
    end = half + BEYOND
    return meshes.cut((-end, end), WIDTH, size, lambda x, y: (y < LAYER) & (np.abs(x) < half), across=(-half, half),
                      along=(LAYER,), seed=int(1000 * size) + draw)


def _viscous_layer(space: Space, ratio: float, interface: str) -> dict[str, float]:
    solution = flow.unit_flow(space, Viscous(ratio), interface=interface_of(interface))
    return in_the_middle(space, solution, layered_channel, ratio)


def middle_of(grid: Mesh, half: float) -> np.ndarray:
    """(T,) triangles with |x| < half (um)."""
    return np.abs(grid.points[grid.triangles, 0].mean(axis=1)) < half


def in_the_middle(space: Space, solution: flow.UnitFlow, reference: ModuleType, parameter: float,
                  half: float = MIDDLE) -> dict[str, float]:
    """Errors against a reference, whose parameter is a ratio of viscosities or a permeability."""
    middle = middle_of(space.mesh, half)

    def exact(x, y):
        return np.stack([reference.velocity(y, WIDTH, LAYER, parameter), 0 * y], axis=-1)

    gradient = reference.gradient(WIDTH, LAYER, parameter)
    return {"velocity": meshes.field_error(space, solution.velocity, exact, middle),
            "velocity in the layer": meshes.field_error(space, solution.velocity, exact, middle & space.mesh.biomass),
            "gradient": abs(slope(space, solution.pressure, middle) / gradient - 1)}


def slope(space: Space, pressure: np.ndarray, chosen: np.ndarray) -> float:
    """-dp/dx by least squares over some triangles."""
    where, weight, _ = meshes.fine(space, chosen)
    p = pressure[space.mesh.triangles[chosen]] @ meshes.fine_linear(space).T
    return -np.polyfit(where[..., 0].ravel(), p.ravel(), 1, w=np.sqrt(weight.ravel()))[0]


#: Half length (um) of the permeable layer, and element sizes (um) with the number of meshes of each.
PERMEABLE_END, PERMEABLE_SIZES = 150.0, dict(zip(LAYER / np.array([2.0, 3.0, 4.0, 6.0]), (4, 3, 2, 1)))
#: Permeabilities (um2): a boundary layer of 10 um, which all sizes resolve, and one of 0.03 um, which none resolves.
RESOLVED, TIGHT = 100.0, 1e-3
#: Third order; on unrelated meshes by sizes 1.33 apart, orders scatter more than by sizes 2 apart.
THIRD = {"velocity": (around(3, 0.8), "quadratic elements: third order in L2", 2e-4)}


@pytest.mark.slow
@pytest.mark.case(
    "flow-permeable-layers", kind="exact", mutants=("drag-in-the-water", "drag-halved"),
    references=("brinkman_channel",), runs_with="2", omitted="linear elements are refused with a permeable body")
@pytest.mark.parametrize("interface", FORMS)
def test_permeable_layers(interface, record):
    """Along a permeable layer the flow is that of a layer with Brinkman's drag to third order. A layer too tight to be
    resolved acts as a wall to one percent.

    Norm: middle of a long layer, root mean square over random meshes of a size: L2 of u; relative error of the pressure
    gradient.
    """
    _, _, third, _ = PERMEABLE_SIZES
    record(studies(refine(_permeable_layer, PERMEABLE_SIZES, RESOLVED, interface), THIRD))
    if interface == "laplacian":
        record(at_most(f"gradient, k = {TIGHT:g} um2", _permeable_layer(third, 0, TIGHT, interface)["gradient"], 1e-2,
                       "a wall in place of the layer: 2.5e-3; the elements beside it add about as much"))


#: Half length and elements (um) of a permeable body from wall to wall, and its permeabilities (um2). Layers are 3 um to
#: 1 nm thick, and elements resolve the first.
SPAN, SPAN_SIZE, SPAN_PERMEABILITIES = 125.0, 10.0, (9.0, 1.0, 1e-2, 1e-4, 1e-6)
#: Three bounds: the excess energy of a layer in one dimension with the longest allowed elements; the square of a
#: quarter, because neighbours and therefore their layers differ in size by a quarter; and the remainder of the ends in
#: the middle, exp(-pi 100 / 50) times a hundredth of the gradient.
LAYER_EXCESS, NEIGHBOURS, FROM_THE_ENDS = 0.18, 0.25**2, 2e-5


@pytest.mark.case(
    "flow-permeable-plug", kind="exact", mutants=("drag-halved", "drag-layer-sticks", "drag-layer-slides-freely"),
    references=("brinkman_channel",), runs_with="2", omitted="linear elements are refused with a permeable body")
@pytest.mark.parametrize("interface", FORMS)
def test_permeable_plug(interface, record):
    """The flow through a permeable body from wall to wall is that of Brinkman's equation, with layers on the walls that
    are resolved or as thin as a ten thousandth of an element, and the velocity is nowhere reversed.

    Norm: middle of a long plug: relative error of the pressure gradient; least velocity along the pore at a node, over
    the mean.

    Two layers of thickness d take 2 k / (d W) of the loss.
    """
    space = meshes.space_on(meshes.plug((-SPAN - BEYOND, SPAN + BEYOND), WIDTH, SPAN, SPAN_SIZE, meshes.cut), 2)
    middle = middle_of(space.mesh, MIDDLE)
    inside = np.unique(space.cells[middle])
    for k in SPAN_PERMEABILITIES:
        solution = flow.unit_flow(space, Permeable(k), interface=interface_of(interface))
        error = abs(slope(space, solution.pressure, middle)
                    / brinkman_channel.gradient(WIDTH, WIDTH, k) - 1)
        thickness = max(np.sqrt(k), SPAN_SIZE / ACROSS / 2)
        record(at_most(
            f"gradient, k = {k:g} um2", error,
            (LAYER_EXCESS + NEIGHBOURS) * 2 * k / (WIDTH * thickness) + FROM_THE_ENDS,
            "the layers' share of the loss times their excess, elements half as long as the mean; the ends"))
        record(at_least(f"velocity, k = {k:g} um2", solution.velocity[inside, 0].min(), -1e-2,
                        "no node overshoots on a line of elements; a hundredth is for triangles"))


def _permeable_layer(size: float, draw: int, permeability: float, interface: str) -> dict[str, float]:
    space = meshes.space_on(_layered(PERMEABLE_END, size, draw), 2)
    solution = flow.unit_flow(space, Permeable(permeability), interface=interface_of(interface))
    return in_the_middle(space, solution, brinkman_channel, permeability)


DISC_ENDS = (-25.0, 25.0)
CENTRE = np.array([2.0, 24.0])
DISC_RADIUS = 15.0
ANGLE = 0.4
SOFT_AND_STIFF = viscous(10.0, RATIO)
JUMP = "1/2, from above: a continuous pressure cannot jump, the smooth part of the error falls faster"
STIFF = JUMP + "; the more if lambda multiplies the error of the disc's strain"
FULL_DISC = (2, "linear elements: second order; the jump's own share is smaller on these meshes", 1e-3)
SLOWER = ((0.9, 1.8), "from 2 (chords of the circle) or more down to 1 (the jump)", 1e-3)
#: Polygons and round discs: order of the elements, kind of mesh, element sizes (um) with the number of meshes of each,
#: orders of the velocity at lambda = 10 and 2000, and of the pressure at lambda = 2000.
SMEARED = ((0.35, 0.8), JUMP, 0.3)
POLYGON = {"order 1": (1, meshes.disc, {4.8: 12, 2.4: 8, 1.2: 4, 0.6: 1}, FULL_DISC, FULL_DISC,
                       ((0.35, 1.2), STIFF, 0.3))}
POLYGON_2 = {"order 2": (2, meshes.disc, {6.0: 12, 3.0: 8, 1.5: 4, 0.75: 1}, SLOWER,
                         (2, "chords of the circle: second order", 3e-4), SMEARED)}
ROUND = {"round, order 2": (2, meshes.round_disc, {6.0: 6, 3.0: 4, 1.5: 2, 0.75: 1}, SLOWER, (
             (2.5, 3.3), "third order in L2, from below while the circle has few edges", 5e-5), SMEARED)}


def inclusion(disc: tuple, ratio: float, interface: str):
    order, kind, sizes, soft, stiff, pressure = disc
    velocity, jump = (soft, SMEARED) if ratio < RATIO else (stiff, pressure)

    def exact(x, y):
        u, p = viscous_inclusion.fields(x - CENTRE[0], y - CENTRE[1], DISC_RADIUS, ratio, interface, ANGLE)
        return u, p, 0 * u

    errors = refine(_errors, sizes, _disc_grid, kind, order, ratio, interface, exact)
    return studies(errors, {"velocity": velocity, "pressure": jump})


@pytest.mark.case(
    "flow-inclusion", kind="exact", mutants=("traction-transposed", "normal-stress-halved"),
    references=("viscous_inclusion",), omitted="order 2: flow-inclusion-quadratic")
@parametrize("*setup", combined(POLYGON, SOFT_AND_STIFF, FORMS), slow=viscous(RATIO))
def test_inclusion(setup, record):
    """A viscous disc under pure shear strains as the closed form says, for lambda = 10 and 2000 in both forms.

    Norm: root mean square over random meshes of a size, relative L2 of u and p.
    """
    record(inclusion(*setup))


@pytest.mark.slow
@pytest.mark.case(
    "flow-inclusion-quadratic", kind="exact", mutants=("normal-stress-halved", "curved-straight-divergence"),
    references=("viscous_inclusion",), omitted="order 1: flow-inclusion")
@parametrize(
    "*setup",
    {**combined(POLYGON_2, SOFT_AND_STIFF, {"traction": "traction"}), **combined(ROUND, SOFT_AND_STIFF, FORMS)})
def test_inclusion_quadratic(setup, record):
    """With quadratic velocities the jump of the pressure limits the order to one around a soft disc, in both
    forms. Around a stiff disc the order is two on a polygon, because of its chords, and full on a round disc.

    Norm: root mean square over random meshes of a size, relative L2 of u and p.
    """
    record(inclusion(*setup))


def _errors(size: float, draw: int, make_mesh: Callable, setting, *arguments) -> dict[str, float]:
    """Errors on the mesh ``make_mesh(size, draw, how)``. arguments: the other arguments of :func:`box_errors`."""
    return box_errors(make_mesh(size, draw, setting), *arguments)


@cache
def _disc_grid(size: float, draw: int, kind: Callable) -> Mesh:
    return kind(DISC_ENDS, WIDTH, size, CENTRE, DISC_RADIUS, seed=int(1000 * size) + draw)


#: Element sizes of the manufactured flow with the number of meshes of each; bend of the triangles.
BOX, COARSE_BOX = (dict(zip(sizes, (10, 6, 3, 1)))
                   for sizes in ((0.14, 0.07, 0.035, 0.0175), (0.28, 0.14, 0.07, 0.035)))
BEND, STRAIGHT = 0.2, 0.0
FULL = "one more than the elements, in L2"
LAYERS = "3/2 at first (layers of one element along the rim, dp/dn = 0), 1 in the end (linear elements)"
BELOW = "at first that of the velocity, in the end that of its gradient; 0.3 on both sides"
#: Lowest and highest order of the pressure, and why, for each order of the elements.
PRESSURE = {1: ((0.9, 1.7), LAYERS), 2: ((1.7, 3.3), BELOW)}
#: Order, bend, elements, and last errors of velocity and pressure.
SETUPS = {"order 1": (1, STRAIGHT, BOX, 2e-4, 0.06)}
SETUPS_BENT = {"order 2": (2, BEND, COARSE_BOX, 3e-5, 1e-3)}


def manufactured(setup: tuple, ratio: float, interface: str):
    order, bend, sizes, velocity, pressure = setup
    fields = manufactured_flow.evaluate(ratio, interface)
    errors = refine(_errors, sizes, _box_grid, bend, order, ratio, interface, lambda x, y: [f(x, y) for f in fields])
    return studies(errors, {"velocity": (order + 1, FULL, velocity), "pressure": (*PRESSURE[order], pressure)})


@pytest.mark.case(
    "flow-manufactured", kind="manufactured", mutants=("saddle-sign",), references=("manufactured_flow",),
    omitted="order 2: flow-curved-manufactured")
@parametrize("*setup", combined(SETUPS, SOFT_AND_STIFF, FORMS), slow=("traction", *viscous(RATIO)))
def test_manufactured(setup, record):
    """If only the viscosity jumps, all orders are full, for lambda = 10 and 2000 in both forms.

    Norm: root mean square over random meshes of a size, relative L2 of u and p.
    """
    record(manufactured(*setup))


@pytest.mark.slow
@pytest.mark.case(
    "flow-curved-manufactured", kind="manufactured",
    mutants=("curved-straight-divergence", "traction-transposed"),
    references=("manufactured_flow",), omitted="order 1 has straight triangles: flow-manufactured")
@parametrize("*setup", combined(SETUPS_BENT, viscous(10.0), FORMS))
def test_curved_manufactured(setup, record):
    """On bent triangles quadratic velocities are of third order and their pressures of second, if the viscosity jumps
    tenfold at a straight interface, in both forms.

    Norm: root mean square over random meshes of a size, relative L2 of u and p.
    """
    record(manufactured(*setup))


@cache
def _box_grid(size: float, draw: int, bend: float) -> Mesh:
    """A box of unit width cut by an interface through the origin, both turned by ANGLE.

    Triangles are bent if ``bend`` is not zero.
    """
    grid = meshes.cut((-0.6, 0.5), 1.0, size, lambda x, y: x > 0, across=(0.0,), seed=int(1e4 * size) + draw)
    if bend:
        grid = curved(grid, None)
    s, t = (grid.points - [0.0, 0.5]).T
    t = t + bend * s**2
    turned = (s + 1j * t) * np.exp(1j * manufactured_flow.ANGLE)
    return grid.moved(np.column_stack([turned.real, turned.imag]))
