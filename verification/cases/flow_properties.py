"""Properties of every viscous flow: it conserves flux and energy, and is linear in its drive.

Element sizes that grow with the distance from the aggregate are compared with one size everywhere.
"""

from functools import cache

import numpy as np
import pytest

from repro.fem import elements
from repro.fem.space import Space
from repro.march.simulation import simulate
from repro.model import flow, solving
from repro.model.interface import interface_of
from repro.model.meshing import seeded
from repro.model.resistance import Viscous
from repro.scene import Scene, load_scene
from verification.cases.flow import ENDS, FORMS, LENGTH, ORDERS, RATIO, WIDTH, drive
from verification.evidence.cases import combined, parametrize
from verification.evidence.checks import at_least, at_most, each_at_most
from verification.evidence.writing import ROOT, load
from verification.problems import meshes, runs

#: Refinement of the meshes of each order.
REFINED = {1: 1.0, 2: 0.5}
#: Every order with both forms of [E2], and the elements and form of scenes with a preset.
EVERY = {**combined(ORDERS, FORMS), **{preset: (runs.with_preset(preset), "laplacian") for preset in runs.PRESETS}}


def scene_around(radius: float, *numerics: str) -> Scene:
    """A scene with flow alone around a half-disc."""
    return load_scene("flow_only", (f'aggregate.radius="{radius} um"', *numerics))


@cache
def _around(radius: float, elements: int | str) -> Space:
    """A space around a half-disc, of an order or of a preset."""
    if isinstance(elements, str):
        return seeded(scene_around(radius, elements)).space
    return Space(meshes.half_disc(radius, REFINED[elements], ENDS, WIDTH, geometry=elements))


#: Radii (um) of half-discs with bounds of the flux defect of linear u on a coarse mesh; the bound for a plug.
DISCS, DROP = {40.0: 0.012, 46.0: 0.008}, 0.003


@pytest.mark.case(
    "flow-sections", kind="property",
    mutants=("tau-of-water", "carried-by-u-plus", "inlet-not-scaled", "curved-straight-divergence", "inlet-parabola"))
@parametrize("numerics, interface", EVERY)
def test_sections(numerics, interface, record):
    """The same flux passes every section of a pore with or without a plug: to round-off for w = u - tau grad p of
    linear elements and for u itself of quadratic ones, the outlet included, in both forms.

    Norm: largest relative error of the flux through 25 sections, and through the outlet.
    """
    if isinstance(numerics, int):
        plug = meshes.plug(ENDS, WIDTH, 30.0, 3.1 if numerics == 1 else 6.0, meshes.cut)
        record(_carried(meshes.space_on(plug, numerics), interface, "plug", DROP))
    for radius, drop in DISCS.items():
        record(_carried(_around(radius, numerics), interface, f"half-disc of {radius:g} um", drop))


def _carried(space: Space, interface: str, name: str, drop: float):
    """Checks of the flux of the velocity that carries the substrates, and of u with linear elements."""
    solution = flow.unit_flow(space, Viscous(RATIO), interface=interface_of(interface))
    _, _, shape = meshes.fine(space)
    u = shape @ solution.velocity[space.cells]
    why = "(2) tested with linear ramps, round-off"
    if solution.correction is None:
        yield at_most(f"u, {name}", flux_error(space, u), 1e-9, why)
        out = space.outlet.mean(solution.velocity[:, 0])
        yield at_most(f"outlet, {name}", abs(out - 1), 1e-11, "(2) tested with a constant, round-off")
    else:
        yield at_most(f"w, {name}", flux_error(space, u - solution.correction[:, None]), 1e-9, why)
        if interface == "laplacian":
            yield at_most(f"u, {name}", flux_error(space, u), drop, "the defect of u on a coarse mesh, with margin")


def flux_error(space: Space, carried: np.ndarray) -> float:
    """Largest error of the flux through 25 sections of a field at the points of :func:`meshes.fine`.

    The field is (T, q, 2) or (T, 1, 2). It is tested with ramps that fall from one at the inlet to zero at the outlet.
    """
    grid = space.mesh
    _, weight, _ = meshes.fine(space)
    J = elements.jacobian(grid.points[grid.cells], elements.table(grid.geometry, meshes.FINE).derivatives)
    slopes = elements.inverse_transpose(J, elements.determinant(J)) @ elements.derivatives(1, np.zeros((1, 2)))[0].T
    carries = np.einsum("tqi,tqia->ta", weight[..., None] * carried, slopes)
    sections = np.linspace(-65.0, 65.0, 25)[:, None]
    ramps = np.clip((sections + 5.0 - grid.points[: grid.corners, 0]) / 10.0, 0.0, 1.0)
    return np.abs(np.einsum("ta,sta->s", carries, ramps[:, grid.triangles]) / grid.width + 1).max()


@pytest.mark.case("flow-energy", kind="property", mutants=("correction-not-scaled", "loss-per-width"))
@parametrize("numerics, interface", EVERY)
def test_energy(numerics, interface, record):
    """The work of the inlet is the dissipation by viscosity and stabilisation, with order 2 also the head loss times
    the flux, and the flow is linear in its drive.

    Norm: relative difference.
    """
    space = _around(25.0, numerics)
    unit = flow.unit_flow(space, Viscous(RATIO), interface=interface_of(interface))
    work, dissipated = _power(space, unit, interface)
    driven = [flow.scaled(unit, space.mesh, LENGTH, drive(head=head)) for head in (10.0, 20.0)]
    record(at_most("work less dissipation", abs(work / dissipated - 1), 1e-9, "symmetry of the weak form, round-off"))
    record(each_at_most({"twice the head, twice the flow": _off_twice(*driven),
                         "head loss over the head": abs(driven[0].head_loss / 10.0 - 1)}, 1e-12,
                        "linearity, round-off"))
    if space.order > 1:
        record(at_most("loss times flux", abs(unit.loss * WIDTH / dissipated - 1), 1e-9,
                       "the loss is the work of the inlet, round-off"))


def _off_twice(once: flow.Flow, twice: flow.Flow) -> float:
    """Largest difference from two of the ratios of the fields of two flows."""
    fields = [(getattr(once, name), getattr(twice, name)) for name in ("velocity", "head", "correction")]
    return max(abs(np.abs(b).max() / np.abs(a).max() - 2) for a, b in fields if a is not None)


def _power(space: Space, unit: flow.UnitFlow, interface: str) -> tuple[float, float]:
    """Work of the inlet's forces on the unit flow, and a(u, u) + (tau grad p, grad p)."""
    grid, cells = space.mesh, space.cells
    viscosity, count = np.where(grid.biomass, RATIO, 1.0), cells.shape[1]
    blocks = flow.stokes(space, viscosity, interface_of(interface), None)
    moving, pressure = np.hstack([*unit.velocity.T[:, cells]]), unit.pressure[grid.triangles]
    upper = np.einsum("tab,ta,tb->", blocks[:, : 2 * count, : 2 * count], moving, moving)
    forces = np.einsum("tij,tj->ti", blocks, np.hstack([moving, pressure]))
    force = np.bincount(cells.ravel(), forces[:, :count].ravel(), space.count)
    inlet = space.inlet.nodes
    work = force[inlet] @ unit.velocity[inlet, 0]
    if space.order > 1:
        return work, upper
    tau = grid.circumdiameter**2 / (100.0 * viscosity)
    slope = np.einsum("tai,ta->ti", grid.gradients, unit.pressure[grid.triangles])
    return work, upper + np.einsum("t,ti,ti->", tau * grid.areas, slope, slope)


ACCURATE = runs.with_preset("accurate")
#: Bounds of the difference from the loss with one element size, and changes of the scene. The bounds are half of the
#: error that the presets paper and fast promise, and the error that accurate promises.
SCHEMES = {"paper": (5e-3, runs.with_preset("paper")), "fast": (5e-3, runs.with_preset("fast")),
           "accurate": (1e-3, ACCURATE)}


@pytest.mark.case(
    "flow-graded", kind="property", mutants=("gradation-ignored", "gradation-not-passed"), runs_with="1 2")
@parametrize("bound, *numerics", SCHEMES)
def test_graded(bound, numerics, record):
    """Elements that grow with the distance from a half-disc give the loss of elements of one size, with less than half
    of the nodes, on straight triangles and on curved ones.

    Norm: relative difference of the loss; nodes over those of graded sizes; largest over least edge.
    """
    (loss, nodes), (even, many) = (_graded(*numerics, f"numerics.gradation={value}") for value in (0.25, 0.0))
    record(at_most("loss", abs(loss / even - 1), bound,
                   "errors near the aggregate dominate, and the elements there are those of the preset"),
           at_most("nodes", nodes / many, 0.5, "half"))


def _graded(*numerics: str) -> tuple[float, int]:
    """Loss of the pore and nodes of its mesh."""
    scene = scene_around(10.0, *numerics)
    seed = seeded(scene)
    return solving.solve(scene, seed).flow.head_loss, len(seed.mesh.points)


#: Flow enters a permeable aggregate in the gussets beside its upper contact lines.
TIGHT_RUN = ("pore.width=100 um", "aggregate.radius=40 um", "flow.mean_velocity=5.06 m/day",
             "flow.permeability=5.67e-17 m^2")
#: Head loss (um) around the last shape of the run. Cubic elements on a finer mesh gave it.
HEAD_LOSS = load(ROOT / "reference" / "cubic.json")["values"]["flow-permeable-run, head loss (um)"]


@pytest.mark.slow
@pytest.mark.case(
    "flow-permeable-run", kind="property", mutants=("drag-layer-sticks",), runs_with="fast",
    omitted="the other presets have finer elements")
def test_permeable_run(record):
    """A run in which the water must pass through an aggregate with layers of 7.5 nm continues from the film to its end:
    concentrations stay within their bounds, the velocity is nowhere reversed, and the head loss is that of cubic
    elements on a finer mesh.

    Norm: concentrations over the supply; relative difference of the head loss from that recorded in
    reference/cubic.json; least velocity along the pore in the aggregate over the largest.
    """
    overrides = ["numerics.preset=fast", *TIGHT_RUN]
    instants = list(simulate(load_scene("base", overrides, unset=["flow.head"])))
    solved = [instant.solved.concentrations for instant in instants]
    largest = max(max(concentrations.acceptor.max(), concentrations.donor.max()) for concentrations in solved)
    record(at_most("largest concentration", largest / 10.0, 1.01, "half of the accepted overshoot"))
    end, solution = instants[-1].pore, instants[-1].solved.flow
    along = solution.velocity[np.unique(end.space.cells[end.mesh.biomass]), 0]
    record(at_least("least velocity", along.min() / along.max(), -0.01, "no node overshoots on a line of elements"))
    record(at_most("head loss", abs(solution.head_loss / HEAD_LOSS - 1), 0.01, "the error that fast promises: 1 %"))
