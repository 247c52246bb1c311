"""The runs that the claims read: packaged scenes with changes, each computed once in a process, at the present level.

Nothing is written: a run is a list of reports. The converged solution and wide name the times of their rows (`ROWS`),
since their steps end at other times; base in the scheme has a row per shape update. The first state in contact with the
opposite wall and the last state before it are rows of their own.

The module also gives the aggregate, the pore and the stresses of a run at a time, and meshes and solutions around
aggregates of a prescribed shape.
"""

from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import cached_property
from unittest import mock

import numpy as np
import shapely

from repro import results
from repro.fem import mesher
from repro.fem.mesh import Mesh
from repro.fem.outline import Outline, parabola
from repro.fem.outline import half_disc as seed
from repro.fem.sizing import ACROSS_AGGREGATE
from repro.fem.space import Space
from repro.fem.walls import BOTTOM, TOP
from repro.march import loop, simulation
from repro.march.state import Report, RestartState
from repro.model import contact as closing
from repro.model import flow, mesh_motion, meshing, remeshing, solving, transport
from repro.model.kinetics import Sink
from repro.model.mechanics import Expansion, Mechanics, middle_of
from repro.model.pore import Pore
from repro.model.remeshing import Remeshing
from repro.model.solid import Strained
from repro.model.solving import Solved, solve
from repro.model.stages import Stages
from repro.results.arrays import State as Reported
from repro.scene import Scene
from verification.claims.levels import CONVERGED, cached, converged, current
from verification.evidence.checks import columns
from verification.problems.schemes import Change, Exchange, load_scene

#: A packaged scene and its changes, KEY=VALUE or choices of its scheme; and columns of rows, by name.
Run = tuple[Change, ...]
Columns = dict[str, np.ndarray]
#: Section 4 and Figure 6.
BASE, WIDE = ("base",), ("wide",)
#: The shape that the paper plots and the end of its run (h), and a shape update, whatever the level.
PLOTTED, END = 19.2, 19.4
UPDATE = 0.2
SUBSTRATES = ("acceptor", "donor")
#: Hours of the rows of a packaged scene.
ROWS = {"base": (0.2, *map(float, range(1, 20)), 19.2, 19.4), "wide": tuple(map(float, range(1, 121)))}
#: Hours after wide's contact of which conductivities are means: those of `verification.sensitivity.wide`, to the end of
#: Figure 6, every second shape update of the paper.
AFTER = tuple(round(35 + 2 * UPDATE * number, 1) for number in range(26))
#: Changes that no key of a scene makes. The fixed points are at all times the present middles of the contact surfaces
#: [E20]; c of tau or gamma of (35) has another value [E13].
RECHOSEN = "fixed points rechosen"
CONSTANTS = {**{f"c = {c}": (flow, "STABILISATION", float(c)) for c in (25, 50, 200, 400)},
             **{f"gamma = {gamma:g}": (mesh_motion, "COMPRESSIBILITY", gamma) for gamma in (0.1, 10.0)}}
#: Beginnings of the keys whose changes have no effect until the aggregate is near the opposite wall; and the thickness
#: over the pore's width up to which it is not near. A half-disc that spans the pore has more than 1.25 times the area
#: of one of this thickness, also if the last state before lies an update earlier (`approach`).
LATE, NEAR = ("growth.minimum_film", "growth.minimum_contact_angle"), 0.8
#: Time (h) from the last shape with a film to contact: 18 s.
FILM = 0.005
#: Rows of `approach`: a row then has at most 1 % more biomass than the last.
DENSE = 50


def rows_at(*hours: float) -> str:
    """The change of a scene that requests rows at some times (h)."""
    return "output.times=[" + ", ".join(f'"{hour:g} h"' for hour in hours) + "]"


def until(*hours: float) -> tuple[str, str]:
    """The changes that end a run at the last of some times (h), with rows at all of them."""
    return f'growth.end="{hours[-1]:g} h"', rows_at(*hours)


#: Rows of t = 0 and of the last two shapes alone, for runs whose other rows are not needed.
LAST = rows_at(PLOTTED, END)
#: Section 4, if only the last two shapes are needed.
PLATES = (*BASE, LAST)
#: Wide where it is compared with runs that are changed: every 5 h, the hours before its contact, and AFTER.
WIDE_TO_END = ("wide", rows_at(*range(5, 31, 5), *range(31, 35), *sorted({*AFTER, 40})))


def load_packaged(name: str, *changes: Change) -> Scene:
    """A packaged scene with the KEY=VALUE of --set and choices of its scheme, in the elements and steps of the present
    level."""
    level = current()
    changes = tuple(change for change in changes if change not in REPLACED)
    changes = (*level.wide, *changes) if name == "wide" else changes
    if level.kind == CONVERGED:
        return _with_rows(load_scene(name, (*converged(level.size), *changes)))
    scene = load_scene(name, changes)
    numerics = replace(scene.numerics, refinement=scene.numerics.refinement / level.size)
    growth = scene.growth and replace(scene.growth, time_step=round(scene.growth.time_step * level.step, 12))
    scene = replace(scene, numerics=numerics, growth=growth)
    return _with_rows(scene) if name == "wide" else scene


def ending(scene: Scene, *times: float) -> Scene:
    """The scene with rows at some times (h), the last of which is its end."""
    return replace(scene, growth=replace(scene.growth, end=times[-1]), output=replace(scene.output, times=times))


def _with_rows(scene: Scene) -> Scene:
    """The scene with the rows of ROWS, if it grows and requests none."""
    if scene.growth is None or scene.output.times:
        return scene
    times = tuple(time for time in ROWS[scene.name] if time <= scene.growth.end + 1e-9)
    return replace(scene, output=replace(scene.output, times=times))


@dataclass(frozen=True, eq=False)
class History:
    """A run. instants: those of its rows; contact: the last instant without contact with the opposite wall and the
    first one with it, None without contact; far: the last state that is not NEAR that wall."""

    scene: Scene
    instants: tuple[Report, ...]
    contact: tuple[Report, Report] | None
    far: RestartState | None


@cached
def history(*run: Change) -> History:
    """Compute one run. If a change is LATE, the run starts from ``far`` of the run without it. Raises SimulationError
    if the run fails."""
    scene = load_packaged(*run)
    plain = tuple(change for change in run if isinstance(change, Exchange) or not change.startswith(LATE))
    instants: list[Report] = []
    contact = None
    begun = before = far = None if plain == run else history(*plain).far
    with ExitStack() as stack:
        for change in REPLACED.keys() & set(run):
            stack.enter_context(mock.patch.object(*REPLACED[change]))
        for state, instant in simulation.steps(scene, begun):
            if instant:
                instants.append(instant)
            if contact is None and before is not None and state.pore.contact:
                contact = tuple(_solved(scene, touching) for touching in (_with_a_film(scene, before, state), state))
            before = state
            far = state if state.pore.boundary.thickness <= NEAR * scene.pore.width else far
    return History(scene, tuple(instants), contact, far)


_shape_under = closing.shape_under


def _about_middles(keys: Mechanics, grown: Pore, *rest) -> Expansion:
    """The equilibrium of RECHOSEN."""
    middles = [middle_of(grown.boundary, wall) for wall in (BOTTOM, TOP)]
    return _shape_under(keys, grown.with_body(fixed=np.logical_or(*middles)), *rest)


#: What the changes without a key replace: the module, the name and the new value.
REPLACED = {RECHOSEN: (closing, "shape_under", _about_middles), **CONSTANTS}


def _with_a_film(scene: Scene, before: RestartState, contact: RestartState) -> RestartState:
    """The last state that leaves a film: in the converged solution FILM before contact, in the scheme an update."""
    end = contact.pore.time - FILM
    if current().kind != CONVERGED or end <= before.pore.time:
        return before
    *_, (state, _) = simulation.steps(ending(scene, end), before)
    return before if state.pore.contact else state


def _solved(scene: Scene, state: RestartState) -> Report:
    """A state as the instant of a row."""
    solved = solving.solve(scene, state.pore)
    after = replace(state.pore, concentrations=solved.concentrations)
    return loop.make_report(state, after, solved, None, after.mesh.topology)


@cached
def series(*run: str) -> Columns:
    """Columns of a run's rows, as in ``timeseries.csv``."""
    computed = history(*run)
    return columns([results.row(computed.scene, report) for report in computed.instants])


@cached
def around_contact(*run: str) -> Columns:
    """Columns of the last state before contact and of the first after. Raises LookupError without contact."""
    computed = history(*run)
    if computed.contact is None:
        raise LookupError(f"{run} does not touch the opposite wall")
    return columns([results.row(computed.scene, report) for report in computed.contact])


@cached
def approach(*run: str) -> Columns:
    """Columns of DENSE rows at equal intervals of time from the last state that is not NEAR the opposite wall up to
    contact, then those of `around_contact`. The steps are those of the run. Raises LookupError without contact."""
    touching, far = around_contact(*run), history(*run).far
    times = np.linspace(far.pore.time, touching["time_h"][0], DENSE + 1)[1:-1]
    scene = ending(history(*run).scene, *map(float, times))
    dense = [results.row(scene, report) for _, report in simulation.steps(scene, far) if report]
    rows = columns([row for row in dense if row["time_h"] > far.pore.time])
    return {name: np.append(values, touching[name]) for name, values in rows.items()}


def contact_time(*run: str) -> float:
    """Time (h) at which a run touches the opposite wall."""
    return float(around_contact(*run)["time_h"][1])


@cached
def ledger(*run: str) -> Columns:
    """Columns of ``ledger.csv``, of all steps."""
    computed = history(*run)
    ledgers = [step for report in computed.instants for step in report.ledgers]
    steps = np.array([results.ledger_row(computed.scene, step) for step in ledgers], dtype=float)
    return dict(zip(results.LEDGER_COLUMNS, steps.T))


def biomass_defects(run: Run) -> np.ndarray:
    """Relative defect of the biomass in each step of a run."""
    steps = ledger(*run)
    before, grown, after = (steps[f"biomass_{part}_pg_per_m"] for part in ("before", "made", "after"))
    return (after - before - grown) / after


def instant(run: Run, time: float) -> Report:
    """The report of a run at a time (h). Raises KeyError if no row has this time."""
    reports = [report for report in history(*run).instants if abs(report.pore.time - time) < 1e-6]
    if len(reports) != 1:
        raise KeyError(f"{run}: {len(reports)} rows at t = {time} h")
    return reports[0]


def at(run: Run, time: float) -> dict[str, float]:
    """The row of a run at a time (h). Raises KeyError if there is none."""
    return results.row(history(*run).scene, instant(run, time))


def nearest(run: Run, time: float) -> float:
    """Time (h) of the row nearest to a time (h), at which longer steps need not end."""
    return float(min(series(*run)["time_h"], key=lambda hour: abs(hour - time)))


@cached
def grown(run: Run, time: float) -> tuple[Pore, Solved]:
    """The shape of a run at a time (h) with the biomass that grows in it in the next 12 min, and its solution: the
    state "before the aggregate expands" [E12]."""
    return _grown(load_packaged(*run), *solved_pore(run, time))


@cached
def grown_on_new_mesh(run: Run, time: float) -> tuple[Pore, Solved]:
    """The same on a new mesh, whose ends are 1.5 W from the aggregate (3.1) at every level. The ends of the run's own
    mesh depend on the time of the last remesh."""
    return _grown(load_packaged(*run), *remeshed(load_packaged(*run), *solved_pore(run, time)))


def _grown(scene: Scene, pore: Pore, solved: Solved) -> tuple[Pore, Solved]:
    before_expansion, _, _ = Stages.of(scene).transport.make_biomass(pore, solved, UPDATE)
    return before_expansion, solve(scene, before_expansion)


#: Points of an arc of an outline, as a polygon.
PER_ARC = 8


class Body(Reported):
    """The aggregate of a pore, with its strains and stresses as a run reports them."""

    @property
    def grid(self) -> Mesh:
        """The mesh."""
        return self.pore.mesh

    @property
    def outline(self) -> Outline:
        """The aggregate's boundary."""
        return self.pore.boundary

    @property
    def triangles(self) -> np.ndarray:
        """(t, 3 or 6) of the biomass."""
        return self.grid.cells[self.grid.biomass]

    @property
    def corners(self) -> np.ndarray:
        """(t, 3) of the biomass."""
        return self.grid.triangles[self.grid.biomass]

    @property
    def areas(self) -> np.ndarray:
        """(t,) um2 of the biomass triangles, of curved ones too."""
        return self.pore.space.at.dx[self.grid.biomass].sum(axis=1)

    @cached_property
    def strained(self) -> Strained:
        """F and J since t = 0 at the points where growth is integrated."""
        return self.pore.body.solid.strained(self.grid.points[self.grid.body])

    def concentration(self, name: str) -> np.ndarray:
        """(N,) mg/L of a substrate."""
        return getattr(self.solved.concentrations, name)


def body_of(scene: Scene, report: Report) -> Body:
    """The aggregate at an instant."""
    return Body(scene, report.pore, report.solved)


@cached
def body(run: Run, time: float) -> Body:
    """The aggregate of a run in its row at a time (h). Raises KeyError where there is none."""
    return body_of(load_packaged(*run), instant(run, time))


@cached
def bodies(run: Run) -> tuple[Body, ...]:
    """The aggregate in every row of a run."""
    computed = history(*run)
    return tuple(body_of(computed.scene, report) for report in computed.instants)


def polygon(outline: Outline) -> shapely.Polygon:
    """The area inside an outline; arcs by PER_ARC chords."""
    if outline.geometry == 1:
        return shapely.Polygon(outline.points)
    t = np.arange(PER_ARC) / PER_ARC
    return shapely.Polygon(np.einsum("qa,eai->eqi", parabola(t), outline.arcs(outline.points)).reshape(-1, 2))


def solved_pore(run: Run, time: float) -> tuple[Pore, Solved]:
    """The pore of a run at a time (h) and its solution."""
    report = instant(run, time)
    return report.pore, report.solved


def remeshed(chosen: Scene, pore: Pore, solved: Solved) -> tuple[Pore, Solved]:
    """The same aggregate in a new mesh of the extent that the scene requests, solved."""
    new, _ = remeshing.remesh(Remeshing.of(chosen), pore, pore, solved.flow.mean_velocity)
    return new, solve(chosen, new)


def stress(aggregate: Body) -> np.ndarray:
    """(t, 4) Cauchy stress over mu_L, the mean over each triangle: xx, yy, zz, xy."""
    means = [aggregate.mean(part) for part in np.moveaxis(aggregate.stress, -1, 0)]
    return np.stack(means, axis=1) / aggregate.scene.growth.shear_modulus


def in_plane(stresses: np.ndarray) -> np.ndarray:
    """(t,) half the difference of the two principal stresses in the plane, the part that can change the shape."""
    xx, yy, _, xy = stresses.T
    return np.hypot(0.5 * (xx - yy), xy)


def equivalent(stresses: np.ndarray) -> np.ndarray:
    """(t,) equivalent (von Mises) stress of the full deviator, including the direction across the plane."""
    xx, yy, zz, xy = stresses.T
    return np.sqrt(0.5 * ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) + 3 * xy**2)


Both = tuple[transport.Fluxes, transport.Fluxes]


def solution(scene, grid: Mesh, active: np.ndarray) -> tuple[flow.Flow, Both]:
    """Flow under the scene's drive, then the ledger of both steady substrates over X_A (N,) mg/L."""
    flow_field = flow_in(scene, grid)
    scheme = replace(scene.numerics.scheme, modified_newton=False)
    space = Space(grid)
    problem = transport.problem(space, flow_field, scene.substrates, scene.kinetics, scheme)
    sink = Sink(space.integration.to_points(active) * space.reaction.dx)
    state = transport.steady(problem, sink)
    return flow_field, transport.fluxes(problem, sink, state)


def flow_in(scene, grid: Mesh) -> flow.Flow:
    """Flow under the scene's drive."""
    return solving.Solver.of(scene).solve_flow(Space(grid), scene.flow)


def full_biomass(scene, grid: Mesh) -> np.ndarray:
    """X_A (N,) = X_m on the aggregate."""
    active = np.zeros(len(grid.points))
    active[grid.body] = scene.kinetics.maximum_density
    return active


def half_disc(scene, radius: float, reach: float) -> Mesh:
    """The mesh around a half-disc, to the distance ``reach`` (um) on both sides, or to the pore's ends."""
    end = min(radius + reach, scene.pore.length / 2)
    numerics = scene.numerics
    outline = seed(radius, ACROSS_AGGREGATE * numerics.refinement, numerics.scheme.order)
    return mesher.generate_around([outline], (-end, end), meshing.sized(scene), numerics.scheme.order)[0]


def plug(scene, first: float, last: float) -> Mesh:
    """Biomass over the whole width between two x (um), meshed to 1.5 W on both sides."""
    width = scene.pore.width
    points = np.array([(first, 0.0), (last, 0.0), (last, width), (first, width)])
    outline = Outline(points, np.repeat([BOTTOM, TOP], 2), np.zeros(4, bool), points)
    return mesher.generate_around([outline], (first - 1.5 * width, last + 1.5 * width), meshing.sized(scene))[0]


def halved(lattice: np.ndarray, falling=False) -> np.ndarray:
    """(2 (m - 1) (n - 1), 3) triangles of a lattice of nodes (m, n), along x and y: squares halved by the diagonal that
    rises with x, or by the falling one where ``falling``."""
    near, far = lattice[:-1], lattice[1:]
    a, b, c, d = (corner.ravel() for corner in (near[:, :-1], far[:, :-1], far[:, 1:], near[:, 1:]))
    return np.hstack([np.where(falling, [a, b, d], [a, b, c]), np.where(falling, [b, c, d], [a, c, d])]).T


def uncovered(first: shapely.Polygon, second: shapely.Polygon) -> float:
    """Area that only one of two shapes covers, in percent of the first one's."""
    return 100 * float(first.symmetric_difference(second).area / first.area)


def upstream_part(first: shapely.Polygon, last: shapely.Polygon) -> float:
    """Share of the area covered at one time and not at an earlier one that lies at x < 0."""
    new = last.difference(first)
    return shapely.clip_by_rect(new, -1e6, -1e6, 0.0, 1e6).area / new.area
