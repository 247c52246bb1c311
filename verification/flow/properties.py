"""What no viscous flow may do, whatever its numbers: lose flux or energy, know its direction, gain by an obstacle.

Element sizes that grow with the distance from the aggregate, against one size everywhere.
"""

from __future__ import annotations

from functools import cache
from itertools import product

import numpy as np

from repro.fem import elements
from repro.fem.mesh import Mesh
from repro.fem.space import Space
from repro.march.simulation import simulate
from repro.model import flow, pore
from repro.scene import Scene, load_scene
from verification.flow.closed_forms import ENDS, FORMS, LENGTH, ORDERS, RATIO, WIDTH, drive
from verification.kernel.case import at_least, at_most, case, combined, each_at_most
from verification.problems import meshes, runs

#: Refinement of the meshes of each order.
REFINED = {1: 1.0, 2: 0.5, 3: 0.4}
#: Every order with both forms, and what the elements of scenes with a preset are, with the form of [E2] that is theirs.
EVERY = {**combined(ORDERS, FORMS), **{preset: (runs.by(preset), "laplacian") for preset in runs.PRESETS}}


def scene_around(radius: float, *numerics: str) -> Scene:
    """Flow alone, around a half-disc."""
    return load_scene("flow_only", (f'aggregate.radius="{radius} um"', *numerics))


@cache
def _around(radius: float, made: int | str, lean: float = 0.0, reach: float = 75.0) -> Space:
    """Around a half-disc: functions of an order, or as scenes with a preset have them; one that leans is sheared."""
    if isinstance(made, int):
        order, refinement = made, REFINED[made]
    else:
        scene = scene_around(radius, made)
        if not lean:
            return pore.seeded(scene).space
        order, refinement = scene.numerics.order, scene.numerics.refinement
    return Space(meshes.half_disc(radius, refinement, (-reach, reach), WIDTH, geometry=min(order, 2), lean=lean), order)


#: Radii of the half-discs (um), with the defect of u of linear elements on a coarse mesh, with margin; that of a plug.
DISCS, DROP = {40.0: 0.012, 46.0: 0.008}, 0.003


@case("flow-sections", kind="property",
      norm="largest relative error of the flux through 25 sections, and through the outlet",
      claim="The same flux passes every section of a pore, plugged or not: to round-off for w = u - tau grad p of "
            "linear elements and for u itself of quadratic and cubic ones, the outlet included, in both forms",
      mutants=("tau-of-water", "carried-by-u-plus", "inlet-not-scaled", "curved-straight-divergence",
               "inlet-parabola"), over=EVERY)
def sections(made: int | str, interface: str):
    if isinstance(made, int):
        plug = meshes.plug(ENDS, WIDTH, 30.0, 3.1 if made == 1 else 6.0, meshes.cut)
        yield _carried(meshes.space_on(plug, made), interface, "plug", DROP)
    for radius, drop in DISCS.items():
        yield _carried(_around(radius, made), interface, f"half-disc of {radius:g} um", drop)


def _carried(space: Space, interface: str, name: str, drop: float):
    """Errors of the flux of what carries the substrates; of linear elements of u itself besides."""
    found = flow.unit_flow(space, RATIO, interface=interface)
    _, _, shape = meshes.fine(space)
    u = shape @ found.velocity[space.cells]
    why = "(2) tested with linear ramps, round-off"
    if found.correction is None:
        yield at_most(f"u, {name}", flux_error(space, u), 1e-9, why)
        out = space.mean_over(space.dofs.outlet, found.velocity[:, 0])
        yield at_most(f"outlet, {name}", abs(out - 1), 1e-11, "(2) tested with a constant, round-off")
    else:
        yield at_most(f"w, {name}", flux_error(space, u - found.correction[:, None]), 1e-9, why)
        if interface == "laplacian":
            yield at_most(f"u, {name}", flux_error(space, u), drop, "the defect of u on a coarse mesh, with margin")


def flux_error(space: Space, carried: np.ndarray) -> float:
    """Largest error of the flux through 25 sections of a field (T, q, 2) in the points of :func:`meshes.fine`, or
    (T, 1, 2): tested with functions of the corners that fall from one at the inlet to zero at the outlet, each a ramp.
    """
    grid = space.mesh
    _, weight, _ = meshes.fine(space)
    slopes = elements.points(grid.points[grid.cells], elements.table(1, grid.geometry, meshes.FINE)).slopes
    carries = np.einsum("tqi,tqia->ta", weight[..., None] * carried, slopes)
    sections = np.linspace(-65.0, 65.0, 25)[:, None]
    ramps = np.clip((sections + 5.0 - grid.points[: grid.corners, 0]) / 10.0, 0.0, 1.0)
    return np.abs(np.einsum("ta,sta->s", carries, ramps[:, grid.triangles]) / grid.width + 1).max()


@case("flow-energy", kind="property", norm="relative difference",
      claim="The work of the inlet is what viscosity and stabilisation dissipate, of order 2 and 3 the head loss times "
            "the flux, and the flow is linear in its drive",
      mutants=("correction-not-scaled", "loss-per-width"), over=EVERY)
def energy(made: int | str, interface: str):
    space = _around(25.0, made)
    unit = flow.unit_flow(space, RATIO, interface=interface)
    work, dissipated = _power(space, unit, interface)
    driven = [flow.scaled(unit, space.mesh, LENGTH, drive(head=head)) for head in (10.0, 20.0)]
    yield at_most("work less dissipation", abs(work / dissipated - 1), 1e-9, "symmetry of the weak form, round-off")
    yield each_at_most({"twice the head, twice the flow": _off_twice(*driven),
                        "head given, head lost": abs(driven[0].head_loss / 10.0 - 1)}, 1e-12, "linearity, round-off")
    if space.order > 1:
        yield at_most("loss times flux", abs(unit.loss * WIDTH / dissipated - 1), 1e-9,
                      "the loss is the work of the inlet, round-off")


def _off_twice(once: flow.Flow, twice: flow.Flow) -> float:
    """By how much the ratios of the fields of two flows differ from two."""
    fields = [(getattr(once, name), getattr(twice, name)) for name in ("velocity", "head", "correction")]
    return max(abs(np.abs(b).max() / np.abs(a).max() - 2) for a, b in fields if a is not None)


def _power(space: Space, unit: flow.UnitFlow, interface: str) -> tuple[float, float]:
    """Work of the inlet's forces on the unit flow, and a(u, u) + (tau grad p, grad p)."""
    grid, cells = space.mesh, space.cells
    viscosity, count = np.where(grid.biomass, RATIO, 1.0), cells.shape[1]
    blocks = flow.stokes(space, viscosity, interface, None)
    moving, pressure = np.hstack([*unit.velocity.T[:, cells]]), unit.pressure[flow.pressure_space(space).cells]
    upper = np.einsum("tab,ta,tb->", blocks[:, : 2 * count, : 2 * count], moving, moving)
    forces = np.einsum("tij,tj->ti", blocks, np.hstack([moving, pressure]))
    force = np.bincount(cells.ravel(), forces[:, :count].ravel(), space.count)
    inlet = space.end_nodes(space.dofs.inlet)
    work = force[inlet] @ unit.velocity[inlet, 0]
    if space.order > 1:
        return work, upper
    tau = grid.circumdiameter**2 / (100.0 * viscosity)
    slope = np.einsum("tai,ta->ti", grid.gradients, unit.pressure[grid.triangles])
    return work, upper + np.einsum("t,ti,ti->", tau * grid.areas, slope, slope)


@case("flow-reversed", kind="property", norm="L2 of the difference of both velocities, in the middle and everywhere",
      claim="Flow through a leaning aggregate is its mirror image's flow mirrored, since Stokes flow is reversible",
      mutants=("outlet-free",), over=EVERY)
def reversed_flow(made: int | str, interface: str):
    space = _around(25.0, made, 0.6, 150.0)
    mirror = Space(_mirrored(space.mesh), space.order)
    there, back = (flow.unit_flow(way, RATIO, interface=interface).velocity for way in (space, mirror))
    _, weight, shape = meshes.fine(space)
    apart, whole = (np.einsum("tq,tqi->t", weight, (shape @ field[space.cells]) ** 2)
                    for field in (there - back * [1.0, -1.0], there))
    near = np.abs(space.mesh.points[space.mesh.triangles, 0]).max(axis=1) < 40
    for where, chosen, bound, why in (
            ("around the aggregate", near, 1e-6, "what differs at inlet and outlet decays like exp(-4.2 x / W)"),
            ("everywhere", slice(None), 5e-4, "second order, in the layer where inlet and outlet differ")):
        yield at_most(f"difference {where}", np.sqrt(apart[chosen].sum() / whole.sum()), bound, why)


def _mirrored(grid: Mesh) -> Mesh:
    """The mesh with inlet and outlet exchanged, nodes numbered as before."""
    cells = grid.cells[:, [2, 1, 0, 4, 3, 5][: grid.cells.shape[1]]]
    return Mesh.of(grid.points * [-1.0, 1.0], cells, grid.biomass, grid.loop, WIDTH, grid.ends)


RATIOS = np.array([1.0, 2.0, 10.0, 100.0, 2000.0, 1e5])


@case("flow-obstacle", kind="property", norm="head losses for six lambda, over that of the clean channel",
      claim="Viscous biomass never raises the conductivity: the loss rises with lambda, ever more slowly, and with R",
      mutants=("thin-biomass",), over=EVERY)
def obstacle(made: int | str, interface: str):
    """Losses of four half-discs."""
    spaces = [_around(radius, made) for radius in (5.0, 25.0, 40.0, 46.0)]
    losses = np.array([flow.unit_flow(space, ratio, interface=interface).loss
                       for space, ratio in product(spaces, RATIOS)]).reshape(len(spaces), -1)
    rises = np.diff(losses, axis=1)
    slopes = rises / np.diff(RATIOS)
    why = "least dissipation (Helmholtz): the loss is the least of functions that are linear in lambda"
    return [at_least("least rise with lambda, over the loss",
                     (rises / losses[:, 1:]).min(), 0.0, why),
            at_most("largest slope over the one before", (slopes[:, 1:] / slopes[:, :-1]).max(), 1.0, why),
            at_least("least rise with R at lambda = 2000, over the loss",
                     (np.diff(losses[:, 4]) / losses[1:, 4]).min(), 0.0, "nested obstacles: " + why)]


ACCURATE = runs.by("accurate")
#: How far the loss may be from that on sizes which are the same everywhere: half of what the presets paper and fast are
#: for, and what accurate is for; and what the mesh is made with.
SCHEMES = {"paper": (5e-3, runs.by("paper")), "fast": (5e-3, runs.by("fast")), "accurate": (1e-3, ACCURATE),
           "cubic": (1e-3, ACCURATE, runs.of("cubic"))}


@case("flow-graded", kind="property",
      norm="relative difference of the loss; nodes over those of graded sizes; largest over least edge",
      claim="With one element size everywhere the loss of a half-disc is that of sizes which grow with the distance "
            "from it, for more than twice the nodes, on straight triangles and on curved ones of order 2 and 3",
      mutants=("gradation-ignored", "gradation-not-passed"), over=SCHEMES, ways="1 2")
def graded(bound: float, *numerics: str):
    (loss, nodes), (even, many) = (_graded(*numerics, f"numerics.gradation={value}") for value in (0.25, 0.0))
    return (at_most("loss", abs(loss / even - 1), bound,
                    "errors near the aggregate rule: those of the preset's elements there"),
            at_most("nodes", nodes / many, 0.5, "half"))


def _graded(*numerics: str) -> tuple[float, int]:
    """Loss of the pore and nodes of its mesh."""
    scene = scene_around(10.0, *numerics)
    now = pore.seeded(scene)
    return pore.solve(scene, now).flow.head_loss, len(now.mesh.points)


#: Flow enters a permeable aggregate in the gussets beside its upper contact lines.
TIGHT_RUN = ("pore.width=100 um", "aggregate.radius=40 um", "flow.mean_velocity=5.06 m/day",
             "flow.biomass=brinkman", "flow.permeability=5.67e-17 m^2")


@case("flow-permeable-run", kind="property", slow=True,
      norm="concentrations over the supply; relative difference of the head loss from that of a finer mesh; least "
           "velocity along the pore in the aggregate over the largest",
      claim="A run whose water must pass an aggregate with layers of 7.5 nm goes on from the film to its end: "
            "concentrations keep their bounds, the velocity turns back nowhere, head loss is that of a finer mesh",
      mutants=("drag-layer-sticks",), over={"fast": ("numerics.preset=fast",)},
      because="the other presets refine what fast has")
def permeable_run(preset: str):
    overrides = [preset, *TIGHT_RUN]
    instants = list(simulate(load_scene("base", overrides, ["flow.head"])))
    solved = [instant.solved.concentrations for instant in instants]
    largest = max(max(each.acceptor.max(), each.donor.max()) for each in solved)
    yield at_most("largest concentration", largest / 10.0, 1.01, "half of what a solution may overshoot by")
    end, found = instants[-1].pore, instants[-1].solved.flow
    along = found.velocity[np.unique(end.space.cells[end.mesh.biomass]), 0]
    yield at_least("least velocity", along.min() / along.max(), -0.01, "no node of a line of elements overshoots")
    scene = load_scene("base", [*overrides, "numerics.refinement=0.6", "numerics.contact_elements=10"], ["flow.head"])
    finer = pore.solve_flow(scene, Space(pore.generate(scene, end.boundary)[0], 3))
    yield at_most("head loss", abs(found.head_loss / finer.head_loss - 1), 0.01, "what fast is for: 1 %")
