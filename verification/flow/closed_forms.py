"""Flow with a known answer: through channels, along layers, past a disc, and flow that is chosen beforehand.

Plane Poiseuille flow in a clean channel, and through a plug, which leaves its profile alone in the Laplacian form. The
stabilised pressure meets a condition that is not its own at inlet and outlet, dp/dn = 0, in a layer of one element:
linear velocities are of second order, but the head loss (6), a difference of mean pressures *at* both ends, is of first
order. Elements of order 2 and 3 hold a parabola and a linear head: all is exact.

A layer of biomass along the lower wall of a long channel: two viscous layers, exact for any ratio of viscosities. The
inlet's parabola turns into the layered profile within a few layers' thicknesses (like exp(-1.1 x / h) in biomass); the
middle of the layer is ten of them away from its ends, where what is left is under 1e-4. The layers meet in a shear that
both forms of [E2] have alike, but in the traction form a layer that is held below and free above forgets its ends more
slowly, like exp(-z x / h) with cos z = z, z = 0.739. Elements of order 2 and 3 hold both parabolas: a coarse mesh of a
longer layer shows that they err by what is left alone.

A permeable layer there: Brinkman's drag instead of a viscosity, exact for any drag. Its boundary layers are sqrt(k)
thick; where elements resolve these, errors fall as the elements' order says. Much thinner ones (1e-15 m2 has 0.03 um)
are not resolved: then the layer is nearly a wall, and what matters to the water beside it is the pressure gradient.

A closed form in the paper's own geometry: how the head loss rises as biomass gets a little thicker than water.

A viscous disc in a sheared fluid: Schmid & Podladchikov's closed form, and its twin in the Laplacian form of [E2]. The
pressure jumps at the interface by as much as it varies, and the continuous one of (3.2) smears the jump over one layer
of elements: an error of order one over an area of order h, 1/2 in L2 whatever the elements. What it costs the velocity
is of first order (its square, by duality): quadratic elements show it where lambda = 10, while beside the second-order
error of linear ones it is not to be seen on these meshes, nor where lambda = 2000 holds the disc stiff. There curved
elements, whose disc is round, keep their own orders until the jump's share is larger.

Manufactured flow through a straight interface: nothing jumps but the viscosity, so that no order is reduced. The force
of the strong form (1) acts in both phases. The stabilisation of linear elements takes no notice of it, as in (3.2),
where there is none: it stays consistent to second order. On bent triangles the interface stays straight: the map
(s, t) -> (s, t + BEND s^2) leaves it so.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from types import ModuleType

import numpy as np

from reference import brinkman_channel, layered_channel, manufactured_flow, poiseuille, viscous_inclusion
from repro.fem import mesher
from repro.fem.mesh import Mesh, curved
from repro.fem.sizing import Sizing
from repro.fem.space import Space
from repro.model import flow
from repro.model.brinkman import ACROSS
from repro.scene import Flow as Drive
from verification.kernel.case import around, at_least, at_most, case, combined, each_at_most, refine, studies
from verification.problems import meshes
from verification.problems.channels import box_errors

WIDTH = 50.0
ENDS = (-75.0, 75.0)
RATIO = 2000.0
#: What cases run over: both forms of [E2], orders of the elements, and (by :func:`viscous`) ratios of viscosities.
FORMS = {form: form for form in ("laplacian", "traction")}
ORDERS = {f"order {order}": order for order in (1, 2, 3)}
HIGHER = {label: order for label, order in ORDERS.items() if order > 1}
#: Length of the whole pore (um), nu / g (um h) and mean velocity (um/h) in the cases that need them.
LENGTH, VISCOSITY, MEAN = 600.0, 3e-4, 2.0
SECOND = "linear elements: second order in L2"
ENDS_FIRST = "first order: the stabilisation's own condition dp/dn = 0 at both ends spoils one layer of elements"
ROUND_OFF = "round-off: the elements hold a parabola and a linear head"


def viscous(*ratios: float) -> dict[str, float]:
    """Ratios lambda of the viscosities, by label."""
    return {f"lambda = {ratio:g}": ratio for ratio in ratios}


def drive(**given) -> Drive:
    """A head (um) or a mean velocity (um/h), as a scene gives it."""
    return Drive(kinematic_viscosity=VISCOSITY, gravity=1.0, **given)


@case("flow-poiseuille", kind="exact", norm="L2 of u over the mesh; relative error of the head loss over it, and of "
      "the conductivity of a pore of 600 um",
      claim="In a clean channel the flow is plane Poiseuille's, in both forms of [E2]",
      mutants=("saddle-sign", "tau-linear", "upper-wall-slips", "outlet-free", "unmeshed-forgotten"),
      over=combined(FORMS), ways="1", because="orders 2, 3: flow-curved-poiseuille")
def poiseuille_channel(interface: str):
    return studies(refine(_clean, (0.7, 1.25, 2.2, 3.9), interface),
                  {"velocity": (2, SECOND, 3e-4), "head loss": (1, ENDS_FIRST, 6e-3),
                   "conductivity": (1, ENDS_FIRST, 1.5e-3)})


def _clean(refinement: float, interface: str) -> dict[str, float]:
    grid, _ = mesher.generate(None, ENDS, Sizing(WIDTH, refinement, 2.0))
    return {"size": meshes.mean_size(grid), **_poiseuille_errors(Space(grid, 1), 0.0, interface)}


def _poiseuille_errors(space: Space, half: float, interface: str = "laplacian") -> dict[str, float]:
    """Of a channel with a plug of half a length (um) or none; the conductivity is that of a clean pore."""
    found = flow.solve(space, drive(mean_velocity=MEAN, viscosity_ratio=RATIO), LENGTH, interface=interface)
    exact = poiseuille.head_loss(np.ptp(ENDS) + 2 * half * (RATIO - 1), WIDTH, MEAN, VISCOSITY)
    return {"velocity": meshes.field_error(space, found.velocity / MEAN, _velocity),
            "head loss": abs(found.meshed_loss / exact - 1),
            "conductivity": abs(found.conductivity / poiseuille.conductivity(WIDTH, VISCOSITY) - 1)}


def _velocity(x, y):
    return np.stack([poiseuille.velocity(y, WIDTH), 0 * y], axis=-1)


#: Half length of the plug (um), and elements (um) with how many meshes of each.
PLUG, PLUG_SIZES = 30.0, {8.0: 12, 4.0: 8, 2.0: 4, 1.0: 1}


@case("flow-plug", kind="exact", norm="root mean square over random meshes of a size: L2 of u over the mesh, relative "
      "error of the head loss",
      claim="Through a plug the Laplacian form keeps Poiseuille's profile and loses lambda times its head there",
      mutants=("tau-of-water",), ways="1", because="orders 2, 3: flow-curved-poiseuille")
def plug():
    return studies(refine(_plug_errors, PLUG_SIZES), {
        "velocity": (2, SECOND, 5e-4),
        "head loss": (2, "second order: the plug's inside outweighs the ends", 1e-3)})


def _plug_errors(size: float, draw: int) -> dict[str, float]:
    grid = meshes.plug(ENDS, WIDTH, PLUG, size, meshes.cut, int(100 * size) + draw)
    return _poiseuille_errors(Space(grid, 1), PLUG)


#: Half length of the plug (um) on curved meshes, whose ends are not alike.
HALF, CURVED_ENDS = 20.0, (-60.0, 70.0)
#: Ratio and form in which the plug leaves the profile alone.
PARABOLAS = {f"lambda = {ratio:g}, {form}": (ratio, form)
             for ratio, form in ((1.0, "laplacian"), (1.0, "traction"), (RATIO, "laplacian"))}


@case("flow-curved-poiseuille", kind="exact",
      norm="largest difference over the largest velocity; relative difference of losses",
      claim="With quadratic and cubic elements a clean channel, in both forms, and one with a plug of biomass of 2000 "
            "times the viscosity have the parabola at every node and the loss (6) of each part, on any mesh; the work "
            "of the inlet is that loss",
      mutants=("viscosity-swapped", "loss-per-width", "inlet-parabola", "whole-pore-twice", "outlet-free",
               "cubic-edge-crossed", "quadratic-stabilised"), over=combined(HIGHER, PARABOLAS),
      because="order 1: flow-poiseuille, flow-plug")
def channels(order: int, given: tuple[float, str]):
    """On six-node triangles with biomass from wall to wall."""
    ratio, interface = given
    space = meshes.space_on(meshes.plug(CURVED_ENDS, WIDTH, HALF, 8.0, seed=3), order)
    found = flow.solve(space, drive(mean_velocity=MEAN, viscosity_ratio=ratio), LENGTH, interface=interface)
    ends = space.mesh.topology
    u = poiseuille.velocity(space.points[:, 1], WIDTH, MEAN)
    plugged = 2 * HALF * (ratio - 1)  # what the plug adds to the length of water that loses as much
    meshed, whole = (poiseuille.head_loss(length + plugged, WIDTH, MEAN, VISCOSITY)
                     for length in (np.ptp(CURVED_ENDS), LENGTH))
    heads = found.head[ends.inlet].mean() - found.head[ends.outlet].mean()
    errors = {"u_x": np.abs(found.velocity[:, 0] - u).max() / u.max(),
              "u_y": np.abs(found.velocity[:, 1]).max() / u.max(),
              "loss as work": abs(found.meshed_loss / meshed - 1),
              "loss of the whole pore": abs(found.head_loss / whole - 1),
              "difference of heads": abs(heads / meshed - 1)}
    return each_at_most(errors, 1e-10, ROUND_OFF)


#: Height and half length of the layer, clean water beyond its ends, and what is compared: |x| < MIDDLE; um.
LAYER = 12.5
LAYER_END = 125.0
BEYOND = 15.0
MIDDLE = 25.0
RATIOS = viscous(1.0, 10.0, 100.0, RATIO, 1e5, 1e8)
SIZES, DRAWS = LAYER / np.array([1.5, 3.0, 6.0, 12.0]), dict(enumerate((16, 12, 6, 1)))
#: Orders of linear elements, and what the errors of the finest meshes may reach; in the traction form what is left of
#: the ends rules in the layer.
LINEAR = {"velocity": (2, SECOND, 1e-3), "velocity in the layer": (2, SECOND, 1e-3), "gradient": (2, SECOND, 1.2e-3)}
STUDIED = {"laplacian": LINEAR, "traction": {"velocity": LINEAR["velocity"]}}
#: Half length (um) of the layer of orders 2 and 3, and what is left of its ends in its middle: exp(-0.739 * 18).
LONG, LEFT = 250.0, 2e-6


@case("flow-layers", kind="exact", slow=True, norm="middle of a long layer, root mean square over random meshes of a "
      "size: L2 of u, of u within the layer (relative to that), and relative error of the pressure gradient",
      claim="Along a layer of biomass the flow is that of two viscous layers, for lambda from 1 to 1e8, to second "
            "order with linear elements in both forms and on any mesh with quadratic and cubic ones",
      mutants=("tau-of-water", "viscosity-swapped"),
      over={**combined({"order 1": 1}, RATIOS, {"laplacian": "laplacian"}),
            **combined({"order 1": 1}, viscous(RATIO), {"traction": "traction"}), **combined(HIGHER, RATIOS, FORMS)})
def layers(order: int, ratio: float, interface: str):
    if order == 1:
        yield studies(refine(_layer_errors, DRAWS, ratio, interface), STUDIED[interface])
    else:
        space = Space(long_layer(), order)
        yield each_at_most(_viscous_layer(space, ratio, interface), LEFT, "what is left of the layer's ends")


def _layer_errors(level: int, draw: int, ratio: float, interface: str) -> dict[str, float]:
    return {"size": SIZES[level], **_viscous_layer(Space(layer_grid(level, draw), 1), ratio, interface)}


@cache
def layer_grid(level: int, draw: int) -> Mesh:
    """Of straight triangles, one of the random meshes of a level of SIZES."""
    return _layered(LAYER_END, SIZES[level], draw)


@cache
def long_layer() -> Mesh:
    """A coarse mesh of six-node triangles of a longer layer."""
    return curved(_layered(LONG, SIZES[0], 0), None)


def _layered(half: float, size: float, draw: int) -> Mesh:
    """The layer from -half to half (um), and clean water beyond."""
    end = half + BEYOND
    return meshes.cut((-end, end), WIDTH, size, lambda x, y: (y < LAYER) & (np.abs(x) < half), across=(-half, half),
                      along=(LAYER,), seed=int(1000 * size) + draw)


def _viscous_layer(space: Space, ratio: float, interface: str) -> dict[str, float]:
    return in_the_middle(space, flow.unit_flow(space, ratio, interface=interface), layered_channel, ratio)


def middle_of(grid: Mesh, half: float) -> np.ndarray:
    """(T,) triangles with |x| < half (um)."""
    return np.abs(grid.points[grid.triangles, 0].mean(axis=1)) < half


def in_the_middle(space: Space, found: flow.UnitFlow, reference: ModuleType, parameter: float,
                  half: float = MIDDLE) -> dict[str, float]:
    """Errors against a reference, which has a ratio of viscosities or a permeability for its parameter."""
    middle = middle_of(space.mesh, half)

    def exact(x, y):
        return np.stack([reference.velocity(y, WIDTH, LAYER, parameter), 0 * y], axis=-1)

    gradient = reference.gradient(WIDTH, LAYER, parameter)
    return {"velocity": meshes.field_error(space, found.velocity, exact, middle),
            "velocity in the layer": meshes.field_error(space, found.velocity, exact, middle & space.mesh.biomass),
            "gradient": abs(slope(flow.pressure_space(space), found.pressure, middle) / gradient - 1)}


def slope(space: Space, pressure: np.ndarray, chosen: np.ndarray) -> float:
    """-dp/dx by least squares over some triangles."""
    where, weight, shape = meshes.fine(space, chosen)
    p = pressure[space.cells[chosen]] @ shape.T
    return -np.polyfit(where[..., 0].ravel(), p.ravel(), 1, w=np.sqrt(weight.ravel()))[0]


#: Half length (um) of the permeable layer, elements (um) and how many meshes of each.
PERMEABLE_END, PERMEABLE_SIZES = 150.0, dict(zip(LAYER / np.array([2.0, 3.0, 4.0, 6.0]), (4, 3, 2, 1)))
#: um2: a boundary layer of ten micrometres, resolved by all sizes; one of three hundredths, by none.
RESOLVED, TIGHT = 100.0, 1e-3
#: Third order; on unrelated meshes by sizes 1.33 apart, orders scatter more than by sizes 2 apart.
THIRD = {"velocity": (around(3, 0.8), "quadratic elements: third order in L2", 2e-4)}
#: Cubic elements against quadratic ones of the same size: a hundredth was measured at a third of the layer.
CUBIC = 0.05


@case("flow-permeable-layers", kind="exact", slow=True, norm="middle of a long layer, root mean square over random "
      "meshes of a size: L2 of u; relative error of the pressure gradient",
      claim="Along a permeable layer the flow is that of a layer with Brinkman's drag: of third order with quadratic "
            "elements, and twenty times nearer with cubic ones; a layer too tight to be resolved acts as a wall to one "
            "percent",
      mutants=("drag-in-the-water", "drag-halved"), over=combined(HIGHER, FORMS),
      because="linear elements are refused with a permeable body")
def permeable(order: int, interface: str):
    _, second, third, _ = PERMEABLE_SIZES
    if order == 2:
        yield studies(refine(_permeable_layer, PERMEABLE_SIZES, RESOLVED, interface, 2), THIRD)
    else:
        cubic, quadratic = (_permeable_layer(second, 0, RESOLVED, interface, each)["velocity"] for each in (3, 2))
        yield at_most("velocity over that of order 2", cubic / quadratic, CUBIC, "the elements' orders")
    if interface == "laplacian":
        yield at_most(f"gradient, k = {TIGHT:g} um2", _permeable_layer(third, 0, TIGHT, interface, order)["gradient"],
                      1e-2, "of a wall instead of the layer: 2.5e-3; what the elements beside it add is of that order")


#: Half length and elements (um) of a permeable body from wall to wall, and its permeabilities (um2): layers of 3 um to
#: 1 nm, the first of which the elements resolve.
SPAN, SPAN_SIZE, SPAN_PERMEABILITIES = 125.0, 10.0, (9.0, 1.0, 1e-2, 1e-4, 1e-6)
#: What elements as long as is allowed add to a layer's energy in one dimension, by order; the square of a quarter, by
#: which neighbours differ in size and so in their layers; and what is left of the ends in the middle: exp(-pi 100 / 50)
#: times a hundredth of the gradient.
LAYER_EXCESS, NEIGHBOURS, FROM_THE_ENDS = {2: 0.18, 3: 0.014}, 0.25**2, 2e-5


@case("flow-permeable-plug", kind="exact", norm="middle of a long plug: relative error of the pressure gradient; least "
      "velocity along the pore at a node, over the mean",
      claim="A permeable body from wall to wall lets through what Brinkman's equation says, with layers on the walls "
            "that are resolved or are a ten thousandth of an element, and its velocity turns back nowhere",
      mutants=("drag-halved", "drag-layer-sticks", "drag-layer-slides-freely"), over=combined(HIGHER, FORMS),
      because="linear elements are refused with a permeable body")
def permeable_plug(order: int, interface: str):
    """Two layers in which the velocity falls by sqrt(k) / d of that beyond take 2 k / (d W) of the loss."""
    space = meshes.space_on(meshes.plug((-SPAN - BEYOND, SPAN + BEYOND), WIDTH, SPAN, SPAN_SIZE, meshes.cut), order)
    middle = middle_of(space.mesh, MIDDLE)
    inside = np.unique(space.cells[middle])
    for k in SPAN_PERMEABILITIES:
        found = flow.unit_flow(space, interface=interface, permeability=k)
        error = abs(slope(flow.pressure_space(space), found.pressure, middle)
                    / brinkman_channel.gradient(WIDTH, WIDTH, k) - 1)
        thickness = max(np.sqrt(k), SPAN_SIZE / ACROSS[order] / 2)
        yield at_most(f"gradient, k = {k:g} um2", error,
                      (LAYER_EXCESS[order] + NEIGHBOURS) * 2 * k / (WIDTH * thickness) + FROM_THE_ENDS,
                      "the layers' share of the loss times their excess, elements half as long as the mean; the ends")
        yield at_least(f"velocity, k = {k:g} um2", found.velocity[inside, 0].min(), -1e-2,
                       "no node of a line of elements overshoots; a hundredth is for triangles")


def _permeable_layer(size: float, draw: int, permeability: float, interface: str, order: int) -> dict[str, float]:
    space = Space(curved(_layered(PERMEABLE_END, size, draw), None), order)
    found = flow.unit_flow(space, interface=interface, permeability=permeability)
    return in_the_middle(space, found, brinkman_channel, permeability)


RADIUS = 25.0
RISE_REFINEMENTS = {0.5: 3, 1.0: 3, 2.0: 3, 4.0: 1}
#: Half the difference of lambda in the central difference, whose own error is of the order of its square.
STEP = 1e-3
RISE_SECOND = "second order, like the dissipation of linear elements; what the ends spoil is in both losses"
#: Refinement of the mesh of orders 2 and 3, and what they may err by: straight triangles hold the parabola, and those
#: beside the arc all but their bow, which is of fourth order in the loss.
CURVED, BOW = 0.5, 1e-5


@case("flow-first-rise", kind="exact", norm="root mean square over meshes of about a size: "
      "relative error of d(head loss)/d(lambda) by a central difference",
      claim="At lambda = 1 the head loss rises with lambda by what Poiseuille flow dissipates in a half-disc: to "
            "second order with linear elements, on a coarse mesh with quadratic and cubic ones",
      mutants=("viscosity-swapped", "loss-per-width"), over=combined(ORDERS, FORMS))
def first_rise(order: int, interface: str):
    if order == 1:
        return studies(refine(_rise_error, RISE_REFINEMENTS, interface, 1), {"rise": (2, RISE_SECOND, 4e-4)})
    return [at_most("rise", _rise_error(CURVED, 0, interface, order)["rise"], BOW,
                    "the parabola is held but for the bow of the triangles beside the arc")]


def _rise_error(refinement: float, draw: int, interface: str, order: int) -> dict[str, float]:
    space = meshes.half_disc_space(RADIUS, refinement * meshes.SPREAD[draw], ENDS, WIDTH, order)
    grid = space.mesh
    below, above = (flow.unit_flow(space, 1 + step, interface=interface).loss for step in (-STEP, STEP))
    where, weight, _ = meshes.fine(space, grid.biomass)
    exact = np.sum(weight * poiseuille.dissipation(where[..., 1], WIDTH)) / WIDTH
    return {"size": meshes.mean_size(grid), "rise": abs((above - below) / (2 * STEP) / exact - 1)}


DISC_ENDS = (-25.0, 25.0)
CENTRE = np.array([2.0, 24.0])
DISC_RADIUS = 15.0
ANGLE = 0.4
SOFT_AND_STIFF = viscous(10.0, RATIO)
JUMP = "1/2, from above: a continuous pressure cannot jump, the smooth part of the error falls faster"
STIFF = JUMP + "; more so where lambda multiplies the error of the disc's strain"
FULL_DISC = (2, "linear elements: second order; the jump's own share is smaller on these meshes", 1e-3)
SLOWER = ((0.9, 1.8), "from 2 (chords of the circle) or more down to 1 (the jump)", 1e-3)
#: Of a polygon or a round disc, with elements of an order: that, elements (um) with how many meshes of each, orders of
#: the velocity where lambda = 10 and 2000, and of the pressure where lambda = 2000.
SMEARED = ((0.35, 0.8), JUMP, 0.3)
POLYGON = {"order 1": (1, meshes.disc, {4.8: 12, 2.4: 8, 1.2: 4, 0.6: 1}, FULL_DISC, FULL_DISC,
                       ((0.35, 1.2), STIFF, 0.3))}
POLYGON_2 = {"order 2": (2, meshes.disc, {6.0: 12, 3.0: 8, 1.5: 4, 0.75: 1}, SLOWER,
                         (2, "chords of the circle: second order", 3e-4), SMEARED)}
ROUND = {"round, order 2": (2, meshes.round_disc, {6.0: 6, 3.0: 4, 1.5: 2, 0.75: 1}, SLOWER, (
             (2.5, 3.3), "third order in L2, from below while the circle has few edges", 5e-5), SMEARED),
         "round, order 3": (3, meshes.round_disc, {8.0: 6, 4.0: 4, 2.0: 2, 1.0: 1}, SLOWER, (
             (0.9, 4.3), "from 4 (cubic elements) down to 1 (the jump)", 1e-5), SMEARED)}


@case("flow-inclusion", kind="exact", norm="root mean square over random meshes of a size, relative L2 of u and p",
      claim="A viscous disc under pure shear strains as the closed form says, for lambda = 10 and 2000 in both forms",
      mutants=("traction-transposed", "normal-stress-halved"), over=combined(POLYGON, SOFT_AND_STIFF, FORMS),
      because="orders 2, 3: flow-inclusion-quadratic")
@case("flow-inclusion-quadratic", kind="exact", slow=True,
      norm="root mean square over random meshes of a size, relative L2 of u and p",
      claim="Quadratic and cubic velocities show what the jump of the pressure costs: first order where the disc gives "
            "way, in both forms; a stiff disc shows the chords of its polygon, second order, or, round, the full order",
      mutants=("normal-stress-halved", "curved-straight-divergence"),
      over={**combined(POLYGON_2, SOFT_AND_STIFF, {"traction": "traction"}), **combined(ROUND, SOFT_AND_STIFF, FORMS)},
      because="order 1: flow-inclusion")
def inclusion(disc: tuple, ratio: float, interface: str):
    order, kind, sizes, soft, stiff, pressure = disc
    velocity, jump = (soft, SMEARED) if ratio < RATIO else (stiff, pressure)

    def exact(x, y):
        u, p = viscous_inclusion.fields(x - CENTRE[0], y - CENTRE[1], DISC_RADIUS, ratio, interface, ANGLE)
        return u, p, 0 * u

    errors = refine(_errors, sizes, _disc_grid, kind, order, ratio, interface, exact)
    return studies(errors, {"velocity": velocity, "pressure": jump})


def _errors(size: float, draw: int, made: Callable, how, *given) -> dict[str, float]:
    """On one of the meshes ``made(size, draw, how)``; given: what :func:`box_errors` takes besides."""
    return box_errors(made(size, draw, how), *given)


@cache
def _disc_grid(size: float, draw: int, kind: Callable) -> Mesh:
    return kind(DISC_ENDS, WIDTH, size, CENTRE, DISC_RADIUS, seed=int(1000 * size) + draw)


#: Elements of the manufactured flow, and how many meshes of each; how much triangles are bent.
BOX, COARSE_BOX = (dict(zip(sizes, (10, 6, 3, 1)))
                   for sizes in ((0.14, 0.07, 0.035, 0.0175), (0.28, 0.14, 0.07, 0.035)))
BEND, STRAIGHT = 0.2, 0.0
FULL = "one more than the elements, in L2"
LAYERS = "3/2 at first (layers of one element along the rim, dp/dn = 0), 1 in the end (linear elements)"
BELOW = "that of the velocity's gradient in the end, the velocity's own at first; 0.3 on both sides"
#: Lowest and highest order of the pressure, and why, for each order of the elements.
PRESSURE = {1: ((0.9, 1.7), LAYERS), 2: ((1.7, 3.3), BELOW), 3: ((2.7, 4.3), BELOW)}
#: Order, bend, elements, and last errors of velocity and pressure.
MADE = {"order 1": (1, STRAIGHT, BOX, 2e-4, 0.06)}
MADE_HIGHER = {"order 2": (2, STRAIGHT, BOX, 1e-6, 3e-4), "order 3": (3, STRAIGHT, COARSE_BOX, 1e-7, 5e-5)}
MADE_BENT = {"order 2": (2, BEND, COARSE_BOX, 3e-5, 1e-3), "order 3": (3, BEND, COARSE_BOX, 1e-6, 1e-4)}


@case("flow-manufactured", kind="manufactured",
      norm="root mean square over random meshes of a size, relative L2 of u and p",
      claim="Where nothing jumps but the viscosity all orders are full, for lambda = 10 and 2000 in both forms",
      mutants=("saddle-sign",), over=combined(MADE, SOFT_AND_STIFF, FORMS),
      because="orders 2, 3: flow-manufactured-quadratic")
@case("flow-manufactured-quadratic", kind="manufactured", slow=True,
      norm="root mean square over random meshes of a size, relative L2 of u and p",
      claim="The same flow with quadratic velocities is of third order, its pressure of second; with cubic ones of "
            "fourth, its pressure of third",
      mutants=("traction-transposed", "cubic-lower-degree"), over=combined(MADE_HIGHER, SOFT_AND_STIFF, FORMS),
      because="order 1: flow-manufactured")
@case("flow-curved-manufactured", kind="manufactured", slow=True,
      norm="root mean square over random meshes of a size, relative L2 of u and p",
      claim="On bent triangles quadratic velocities are of third order and cubic ones of fourth, their pressures of "
            "second and third, where the viscosity jumps tenfold at a straight interface, in both forms",
      mutants=("cubic-edge-crossed", "cubic-slope", "cubic-lower-degree", "curved-straight-divergence",
               "traction-transposed"), over=combined(MADE_BENT, viscous(10.0), FORMS),
      because="order 1 has straight triangles: flow-manufactured")
def manufactured(made: tuple, ratio: float, interface: str):
    order, bend, sizes, velocity, pressure = made
    fields = manufactured_flow.evaluated(ratio, interface)
    errors = refine(_errors, sizes, _box_grid, bend, order, ratio, interface, lambda x, y: [f(x, y) for f in fields])
    return studies(errors, {"velocity": (order + 1, FULL, velocity), "pressure": (*PRESSURE[order], pressure)})


@cache
def _box_grid(size: float, draw: int, bend: float) -> Mesh:
    """A box of unit width cut by the interface, which goes through the origin; both turned by ANGLE; of bent triangles
    where ``bend`` is not zero."""
    grid = meshes.cut((-0.6, 0.5), 1.0, size, lambda x, y: x > 0, across=(0.0,), seed=int(1e4 * size) + draw)
    if bend:
        grid = curved(grid, None)
    s, t = (grid.points - [0.0, 0.5]).T
    t = t + bend * s**2
    turned = (s + 1j * t) * np.exp(1j * manufactured_flow.ANGLE)
    return grid.moved(np.column_stack([turned.real, turned.imag]))
