"""Switches: the paper's choices and their alternatives, each as base with one change.

A switch is a run of the claims (:mod:`verification.claims.runs`) at the paper's 12 min, computed once in a process.
The errata report its rows; the audit reports its difference from base and its cost. Some alternatives have no key in a
scene: the restart value of theta (28), an explicit increment, and an uneven seed. For these, :func:`course` marches a
step or a seed of its own, also once.

Some keys have no switch. With ``growth.wall = "bonded"`` base stops on the paper's mesh at 15.6 h, where a triangle
beside the contact line collapses; the claims judge it in the converged solution. ``flow.permeability``, also with the
fluid's forces, needs quadratic elements. ``growth.bonding_strength`` and ``growth.tensile_strength`` end a run and
change nothing before. Without one of the substrates there is no effluent of it to compare.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from time import process_time

import numpy as np
from scipy.interpolate import CubicSpline

from reference import gold_flow
from repro.fem.outline import Outline
from repro.march import updates
from repro.march.state import Report
from repro.model import mesh_motion, meshing, solving
from repro.model.meshing import Meshing
from repro.model.pore import Pore
from repro.model.solving import Solved
from repro.model.stages import Stages
from repro.results import row
from repro.scene import Scene
from verification.claims import runs
from verification.claims.levels import CONVERGED, FINE, Level, at_level, cached, forget
from verification.claims.runs import BASE, LAST, PLOTTED, UPDATE, Body, Columns, Run
from verification.evidence.checks import columns
from verification.problems import aggregates
from verification.problems.channels import pair
from verification.problems.runs import next_shape, shape_of
from verification.problems.schemes import Change, exchange


@dataclass(frozen=True)
class Switch:
    """choice: the subject of the choice; default, alternative: in words; change: of the scene or of its scheme; state:
    whether both can be compared in one state; note: a remark for the reader; meshes: whether both can use the default's
    meshes."""

    choice: str
    default: str
    alternative: str
    change: Change
    state: bool = True
    note: str = ""
    meshes: bool = True

    @property
    def run(self) -> Run:
        """Base with the change."""
        return changed(self.change)


def changed(change: Change) -> Run:
    """Base with a change, with rows at t = 0 and for the last two shapes."""
    return (*BASE, change, LAST)


#: Effect of the traction form on the conductivity of wide at three times, by NGSolve.
AFTER_CONTACT = ", ".join(f"{100 * (gold_flow.traction_effect(f'wide, {hour}') - 1):+.1f} % ({hour})"
                          for hour in ("35 h", "39.3 h", "45 h"))
F_EXACT = "COD - Y d_c = 2.38 - 0.61 x 1.42; Table 1 prints 1.52 [E1]"
CHOICES = {
    "transient": Switch("transport in time", "quasi-steady", "transient (Gear)", 'numerics.transport="gear"',
                        note="3.3"),
    "full pore": Switch("extent", "central part (3.1)", "full pore", 'numerics.extent="full"', False,
                        "inlet and outlet at most 1.5 W away, against the pore's ends; in the converged solution, "
                        "because the meshes differ", False),
    "traction": Switch("interface", "Laplacian form", "traction form", 'numerics.interface="traction"',
                       note=f"[E2]; base alone: after contact in wide the conductivity changes by {AFTER_CONTACT}"),
    "fluid forces": Switch("fluid forces", "neglected", "included", 'growth.fluid_forces="included"',
                           note="(20), (22), C26"),
    "mean inlet": Switch("inlet condition (11)", "u_x(y)", "u_ave", exchange(inlet="mean"), note="[E4]"),
    "exact F": Switch("acceptor to donor ratio F", "1.52", "1.5138", "kinetics.acceptor_to_donor_ratio=1.5138",
                      note=F_EXACT),
    "linear transfer": Switch("transfer at a remesh", "conserving", "linear", exchange(transfer="interpolation"), False,
                              "[E8]"),
    "stress-free": Switch("new biomass", "stressed", "stress-free", 'growth.new_biomass="stress_free"',
                          note="section 5"),
    "Haldane": Switch("law of uptake", "dual Monod", "Haldane, K_i = 100 mg/L", 'kinetics.law="Haldane"',
                      note="(7)-(10); not the paper's"),
    "unlimited decay": Switch("decay", "with acceptor", "unlimited", 'kinetics.decay="unlimited"',
                              note="(9), (10); not the paper's"),
    "midpoint": Switch("steps in time", "updates of 12 min", "midpoint, tolerance 0.01", exchange(steps="midpoint"),
                       False, "first order in the step against second"),
}
#: Runs that differ from the default in the element size alone; the number of the seed's nodes does not change.
FINENESS = [Switch("mesh", "refinement 1", f"refinement {value}", f"numerics.refinement={value}", False)
            for value in (0.975, 0.98, 0.985, 0.99, 0.995)]


EFFLUENTS = ("acceptor leaving", "donor leaving")


def state(run: Run, time: float = PLOTTED) -> Body:
    """The aggregate of a run at a time (h) that has a row."""
    return runs.body(run, time)


def quantities(aggregate: Body) -> dict[str, float]:
    """Flow, effluents and shape of an aggregate: um/h, mg/L, um2, um."""
    flow, shape = aggregate.solved.flow, aggregate.outline
    return {"velocity": flow.mean_velocity, "conductivity": flow.conductivity,
            **{name: flux.effluent for name, flux in zip(EFFLUENTS, aggregate.solved.fluxes)}, "area": shape.area,
            "thickness": shape.thickness, "upstream": shape.upstream, "downstream": shape.downstream}


def effect(default: Body, alternative: Body) -> dict[str, float]:
    """Relative difference of the other from the default; for effluents, the difference over the supply."""
    supply = dict(zip(EFFLUENTS, pair("supply", alternative.scene.substrates)))
    changed = quantities(alternative)
    return {name: float((changed[name] - value) / supply.get(name, value))
            for name, value in quantities(default).items()}


def effect_of_runs(default: Body, alternative: Body) -> dict[str, float]:
    """Effect between two complete runs. Flow and substrates around the other's shape are solved on the default's mesh,
    which removes the effect of two different meshes."""
    pore_on_mesh = reshaped(default.pore, alternative.outline)
    return effect(default, replace(alternative, solved=solving.solve(alternative.scene, pore_on_mesh)))


def converged(switch: Switch) -> tuple[dict[str, float], dict[str, float]]:
    """Effect between two complete runs in the converged solution on its finest size, and its largest change on the
    coarser sizes: the effect of the mesh."""
    effects = []
    for size in FINE:
        level = Level(CONVERGED, size)
        with at_level(level):
            effects.append(effect(state((*BASE, LAST)), state(switch.run)))
        forget(level)
    return effects[0], {name: float(np.abs(values - values[0]).max()) for name, values in columns(effects).items()}


def reshaped(previous: Pore, outline: Outline) -> Pore:
    """Return the pore with its aggregate moved to another outline along rays from the origin; the fluid's nodes follow.

    Both outlines are star-shaped about the origin and touch the lower wall alone."""
    places = previous.mesh.points[previous.mesh.body]
    angle = np.arctan2(places[:, 1], places[:, 0])
    factor = _radius(outline)(angle) / _radius(previous.outline)(angle)
    return previous.moved(mesh_motion.move(previous.mesh, places * factor[:, None], 1.0))


def _radius(outline: Outline) -> CubicSpline:
    """Distance of the interface from the origin as a smooth function of the angle from downstream."""
    edges = outline.interface_edges()
    x, y = outline.points[edges | np.roll(edges, 1)].T
    angle = np.arctan2(y, x)
    order = np.argsort(angle)
    return CubicSpline(angle[order], np.hypot(x, y)[order])


def one_state(aggregate: Body, alternative: Scene) -> dict[str, float]:
    """Effect in one state: flow, substrates and the next shape, computed with both scenes."""
    bodies = []
    for scene in (aggregate.scene, alternative):
        solved = solving.solve(scene, aggregate.pore)
        bodies.append(Body(scene, next_shape(scene, aggregate.pore, solved, UPDATE), solved))
    return effect(*bodies)


def run_columns(run: Run) -> Columns:
    """Columns of a run's rows: "time" h, "velocity" m/d, "area" um2, effluents "acceptor" and "donor", "drift", largest
    |(X_A + X_I) / X_m - 1|, and "lean", the middle between the tips divided by half of their distance."""
    return _row_columns(runs.series(*run))


def _row_columns(rows: Columns) -> Columns:
    upstream, downstream = rows["upstream_um"], rows["downstream_um"]
    return {"time": rows["time_h"], "velocity": rows["mean_velocity_m_per_d"], "area": rows["aggregate_area_um2"],
            "acceptor": rows["effluent_acceptor_mg_per_L"], "donor": rows["effluent_donor_mg_per_L"],
            "drift": np.maximum(1 - rows["biomass_density_min"], rows["biomass_density_max"] - 1),
            "lean": (upstream + downstream) / (downstream - upstream)}


def near(columns: Columns, name: str, times) -> np.ndarray:
    """A column at times (h)."""
    return columns[name][np.abs(columns["time"] - np.asarray(times)[..., None]).argmin(axis=-1)]


@dataclass(frozen=True, eq=False)
class Course:
    """A run with steps or a seed of its own. seconds: processor time; columns: those of :func:`run_columns`, at t = 0
    and after each update; plotted: the state at 19.2 h, or the last one before.
    """

    seconds: float
    columns: Columns
    plotted: Body


@cached
def course(run: Run, step: Callable[[Scene, Pore, Solved, float], Pore], bulge: float = 0.0) -> Course:
    """March a run's scene in the paper's updates, from a seed with a bulge.

    ``step(scene, pore, solved, hours)`` returns the next pore."""
    scene, start = runs.load_packaged(*run), process_time()
    present = uneven(scene, bulge)
    reports: list[Report] = []
    for time in updates.schedule(scene)[0]:
        if reports:
            present = replace(step(scene, present, reports[-1].solved, time - present.time), time=time)
        solved = solving.solve(scene, present)
        present = replace(present, concentrations=solved.concentrations)
        reports.append(Report(present, solved, None, (), 0, {}))
    rows = columns([row(scene, report) for report in reports])
    plotted = [report for report in reports if report.pore.time < PLOTTED + 1e-6][-1]
    return Course(process_time() - start, _row_columns(rows), runs.body_of(scene, plotted))


def step_of_paper(scene: Scene, previous: Pore, solved: Solved, hours: float) -> Pore:
    """The pore after one step."""
    return updates.step(Stages.of(scene), previous, solved, hours).pore


def restarting_as_j(scene: Scene, previous: Pore, solved: Solved, hours: float) -> Pore:
    """The pore after one step; after a remesh theta = J [E7]."""
    update = updates.step(Stages.of(scene), previous, solved, hours)
    after = update.pore
    if update.remeshed:
        return after.with_body(theta=after.body.solid.strained(after.mesh.points[after.mesh.body]).J)
    return after


def explicit(scene: Scene, previous: Pore, solved: Solved, hours: float) -> Pore:
    """The pore after one step with dX_A = dt F_3 and dX_I = dt F_4 at the rates of its beginning, (28)-(29) [E16]."""
    rates = Stages.of(scene).rates(previous, solved)
    grown = previous.with_masses(previous.active + previous.active * hours * rates.growth,
                                 previous.inert + previous.active * hours * rates.remains)
    return Stages.of(scene).new_mesh(previous, shape_of(scene, previous, grown), solved)[0]


#: The seed's radius is R (1 + BULGE cos 3 phi) or R (1 - BULGE cos 3 phi): the area is the same to second order, one
#: tip is 1 % farther out, and the other 1 % farther in. With cos phi the seed would be a shifted half-disc.
BULGE = 0.01


def uneven(scene: Scene, bulge: float) -> Pore:
    """The pore at t = 0 with a seed of radius R (1 + bulge cos 3 phi), phi from downstream."""
    (seed,) = meshing.initial_outlines(scene)
    points = seed.points * (1 + bulge * np.cos(3 * np.arctan2(*seed.points.T[::-1])))[:, None]
    mesh, (outline,) = Meshing.of(scene).around([replace(seed, points=points, origin=points.copy())])
    return aggregates.seed_on(mesh, outline)
