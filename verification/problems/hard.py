"""Hard cases: their runs, the checks of every run, and the accuracy that a preset promises.

A cell of the matrix is a hard case with a preset. Its verdict is one of three:

right     all checks of its parts hold, and so do the checks of every run (balances, bounds, finite numbers);
refused   a part stops with an error of ``repro`` that names the bound it met or a change to try;
wrong     a check fails, another error is raised, nothing is measured, or a part takes longer than LIMIT.

Every hard case is a verification case whose variants are the presets.
"""

import re
import signal
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest

from reference import poiseuille
from repro.errors import RunEnd, SimulationError, StageError
from repro.march.simulation import simulate
from repro.march.state import Report
from repro.model.meshing import peclet, seeded
from repro.model.pore import Pore
from repro.model.solving import Solved, solve
from repro.results import M_PER_D, row
from repro.scene import Scene, load_scene
from repro.scene.units import SceneError
from verification.evidence.checks import Check, at_least, at_most, between, flat, largest
from verification.problems.channels import NAMES, pair
from verification.problems.runs import NUMERICS, worth

PRESETS = tuple(NUMERICS)
#: With the paper's scheme any part may be refused.
LENIENT = "paper"
#: Relative error that a preset promises in velocity, conductivity, area, thickness and tips, and in effluents over the
#: supply. The paper states none: linear triangles of its sizes were measured 1 to 4 % off in the head loss.
TOLERANCE = {"paper": 0.04, "fast": 0.01, "accurate": 0.001}
PROMISED = {"paper": "linear triangles: 1 to 4 % in the head loss",
            "fast": "what fast is for: 1 %", "accurate": "what accurate is for: 0.1 %"}
#: Bounds of concentrations over the supply that the stages document (UNRESOLVED, Scheme.overshoot).
LOWEST, HIGHEST = -1e-3, 1.02
BALANCE = 1e-9
NEWTON = "Newton's tolerance of 1e-12 a row, times the rows, a thousand at least, over Peclet's number where under one"
FIXED = ('growth.end="0 h"',)


@dataclass(frozen=True, eq=False)
class Run:
    """A finished run: its instants, their rows in ``timeseries.csv``, and the message of RunEnd, or "" without RunEnd.

    balance: bound of the defect of the substrates' balances, None if they are not checked; density: bound of
    |(X_A + X_I) / X_m - 1|, larger if a film closes at once under the aggregate.
    """

    scene: Scene
    instants: Sequence[Report]
    rows: Sequence[dict]
    ended: str = ""
    balance: float | None = BALANCE
    density: float = 0.05

    @property
    def end(self) -> Report:
        """The last instant."""
        return self.instants[-1]

    @property
    def last(self) -> dict:
        """The row of the last instant."""
        return self.rows[-1]

    def column(self, name: str) -> np.ndarray:
        """(rows,) values of a column."""
        return np.array([row[name] for row in self.rows])

    def over_first(self, name: str = "aggregate_area_um2") -> np.ndarray:
        """(rows,) values of a column over the first."""
        return self.column(name) / self.column(name)[0]


@dataclass(frozen=True)
class HardCase:
    """One of the twenty-three hard cases.

    parts: {name: function of the preset that gives Checks and Runs, or lists of them}; refusable: names of the parts
    that ``fast`` and ``accurate`` may refuse (``paper`` may refuse all); mutants: ids of wrong changes that it catches.
    """

    number: int
    id: str
    title: str
    right_is: str
    failure_is: str
    parts: dict[str, Callable[[str], Iterable]]
    refusable: tuple[str, ...] = ()
    mutants: tuple[str, ...] = ()

    @property
    def full_id(self) -> str:
        """The id of its verification case."""
        return f"hard-{self.number:02d}-{self.id}"

    @property
    def mark(self) -> pytest.MarkDecorator:
        """The mark of its verification case."""
        claim = f"{self.title}: {self.right_is[0].lower()}{self.right_is[1:]}"
        return pytest.mark.case(self.full_id, kind="property", claim=claim, norm=NORM, mutants=self.mutants,
                                runs_with="1 2")


def load(name: str, preset: str, *changes: str) -> Scene:
    """A packaged scene with a preset and other changes (KEY=VALUE)."""
    return load_scene(name, (*NUMERICS[preset], *changes))


def run_scene(scene: Scene, simulator: Callable[[Scene], Iterator[Report]] = simulate, **limits) -> Run:
    """Run a scene to its end, the pore's end, or a fold. limits: balance and density of :class:`Run`."""
    instants, ended = [], ""
    try:
        for instant in simulator(scene):
            instants.append(instant)
    except RunEnd as end:
        ended = str(end)
    return Run(scene, instants, [row(scene, instant) for instant in instants], ended, **limits)


def run_packaged(name: str, preset: str, *changes: str, **limits) -> Run:
    """Run a packaged scene with changes. limits: those of :func:`run_scene`."""
    return run_scene(load(name, preset, *changes), **limits)


@cache
def reference(name: str, *changes: str, refinement: float = 1.0) -> Run:
    """A run on finer curved triangles. Its error is well below that of ``accurate`` (refinement 0.45, 0.001)."""
    return run_packaged(name, "accurate", *changes, f"numerics.refinement={refinement}", "numerics.tolerance=0.0005")


def against(name: str, preset: str, changes: Sequence[str], *columns: str, refinement: float = 1.0,
            **limits) -> tuple[Run, Run, list]:
    """A run, a finer run, and the first run with the checks of its columns against the finer one."""
    run = run_packaged(name, preset, *changes, **limits)
    fine = reference(name, *changes, refinement=refinement)
    return run, fine, [run, *close(run, fine, preset, *columns)]


def close(run: Run, finer: Run, preset: str, *columns: str, allowed: float = 0.0) -> Iterator[Check]:
    """Check columns of the last rows against a finer run, to the accuracy that the preset promises.

    Differences are relative, those of effluents over the supply. ``allowed`` replaces the bound of the preset.
    """
    bound = allowed or TOLERANCE[preset]
    origin = f"{PROMISED[preset]}; and what the case allows for" if allowed else PROMISED[preset]
    for column in columns:
        value, expected = run.last[column], finer.last[column]
        size = abs(expected)
        if column in EFFLUENTS:
            size = getattr(run.scene.substrates, column.split("_")[1]).supply
        yield at_most(f"{column} against a finer run", abs(value - expected) / size, bound, origin)


def clean_conductivity(scene: Scene) -> float:
    """Conductivity (m/d) of the pore without an aggregate."""
    drive = scene.flow
    return poiseuille.conductivity(scene.pore.width, drive.kinematic_viscosity / drive.gravity) * M_PER_D


def alike(suffix: str, names: Sequence[str], computed: Sequence[float], expected: Sequence[float], preset: str
          ) -> list[Check]:
    """Check numbers against others. They may differ by the relative error that the preset promises."""
    rows = zip(names, computed, expected)
    return [promised(f"{name} {suffix}", abs(value / other - 1), preset) for name, value, other in rows]


def promised(quantity: str, value: float, preset: str) -> Check:
    """Check a relative error against the one that the preset promises."""
    return at_most(quantity, value, TOLERANCE[preset], PROMISED[preset])


EFFLUENTS = ("effluent_acceptor_mg_per_L", "effluent_donor_mg_per_L")
SHAPE = ("aggregate_area_um2", "thickness_um", "upstream_um", "downstream_um")
DRIVE = ("conductivity_m_per_d",)


def sound(run: Run) -> Iterator[Check]:
    """Checks that hold in every run: the worst over its instants."""
    yield at_most("numbers that are not finite", unreal(run), 0, "none is")
    if run.scene.substrates:
        yield from _balances(run)
        yield from _bounds(run)
    if run.scene.kinetics:
        yield from _biomass(run)


def unreal(run: Run) -> int:
    """Count of numbers in rows and fields that are infinite or not a number."""
    count = sum(not np.isfinite(value) for line in run.rows for value in line.values() if value is not None)
    return count + sum(np.count_nonzero(~np.isfinite(values)) for i in run.instants for values in _fields(i))


def _fields(instant: Report) -> Iterator[np.ndarray]:
    pore, solved = instant.pore, instant.solved
    for part in filter(None, (pore, pore.mesh, pore.body, pore.body.solid, solved.flow, solved.concentrations)):
        yield from (values for values in vars(part).values() if isinstance(values, np.ndarray))


def _balances(run: Run) -> Iterator[Check]:
    if run.balance is None:
        return
    most, origin = run.balance, "the flux is as much smaller than what diffuses"
    if run.balance == BALANCE:
        most, origin = max(BALANCE, 1e-12 * run.last["nodes"] / _slow(run)), NEWTON
    for name in NAMES:
        yield at_most(f"{name} in - out - consumed, over the larger", largest(run.column(f"{name}_balance")), most,
                      origin)


def _slow(run: Run) -> float:
    """The Peclet number u W / D, at most one. Newton's tolerance is relative to the larger flux."""
    speed = (run.last.get("mean_velocity_m_per_d") or 0.0) / 24e-6
    return min(1.0, peclet(run.scene.substrates, run.scene.pore.width, speed)) if speed else 1.0


def _bounds(run: Run) -> Iterator[Check]:
    supplies = pair("supply", run.scene.substrates)
    for name, supply in zip(NAMES, supplies):
        fields = [getattr(i.solved.concentrations, name) for i in run.instants]
        yield at_least(f"{name}'s least over the supply", min(f.min() for f in fields) / max(supplies), LOWEST,
                       "transport.UNRESOLVED")
        if supply:
            yield at_most(f"{name}'s largest over its supply", max(f.max() for f in fields) / supply, HIGHEST,
                          "Scheme.overshoot")


def _biomass(run: Run) -> Iterator[Check]:
    densities = {"least": run.column("biomass_density_min").min(),
                 "largest": run.column("biomass_density_max").max()}
    for extreme, density in densities.items():
        yield between(f"local density over X_m, {extreme}", density, 1 - run.density, 1 + run.density, DENSITY)
    yield between("share of X_I", max(run.column("inert_fraction"), key=abs), -1e-12, 1.0, "a share")
    if run.scene.growth:
        maximum_density = run.scene.kinetics.maximum_density
        apart = max(abs(i.pore.mass / maximum_density / i.pore.outline.area - 1) for i in run.instants)
        yield at_most("biomass after - before - made, over after", largest(run.column("biomass_balance")), BALANCE,
                      MEAN)
        yield at_most("area against biomass over X_m", apart, AREA[run.scene.numerics.scheme.elements], MEAN)
        if run.scene.numerics.scheme.controls_error:
            yield _oxygen_demand(run)


def _oxygen_demand(run: Run) -> Check:
    """Check the yield of the midpoint rule.

    Updates do not have it to round-off, since their uptake and growth use the concentrations of both ends of a step.
    """
    law = run.scene.kinetics
    missing = [abs(ledger.biomass_made - np.subtract(*worth(law, ledger))) / ledger.biomass_after
               for instant in run.instants for ledger in instant.ledgers]
    return at_most("biomass made less what donor makes and acceptor decays, over the biomass",
                   max(missing, default=0.0), 1e-12, "one integral, in the same points; round-off")


MEAN = "J = theta in the mean; Newton's tolerance"
DENSITY = "J = theta holds in the mean over elements: a local density is off by what an element does not resolve [E7]"
#: The area is exact on curved triangles, where masses are transferred. On straight triangles a remesh leaves an error
#: in (34), which the next update removes [E7].
AREA = {"linear": 1e-4, "quadratic": 1e-8}


def solved_seed(scene: Scene) -> tuple[Pore, Solved]:
    """The pore at t = 0, and the flow and transport solved in it."""
    return solved_in(scene, seeded(scene))


def solved_in(scene: Scene, pore: Pore) -> tuple[Pore, Solved]:
    """A pore with its concentrations, and the flow and transport solved in it."""
    solved = solve(scene, pore)
    return replace(pore, concentrations=solved.concentrations), solved


#: Limit of the CPU time (s) of a part: ten times that of the longest.
LIMIT = 200.0
RIGHT = "right"
REFUSED = "refused"
WRONG = "wrong"
#: A refusal must contain one of these words: it names a change to try, or the bound that was met.
REASON = re.compile(r"\b(try|leave|needed|under|above|more than|accepted|outside of)\b")


class TooLong(Exception):
    """A part has exceeded LIMIT."""


@dataclass(frozen=True, eq=False)
class Part:
    """Result of one part: verdict, reason, its own checks, and the checks of every run in it."""

    name: str
    verdict: str
    message: str
    checks: tuple[Check, ...] = ()
    always: tuple[Check, ...] = ()

    @property
    def bounds(self) -> list[list[str]]:
        """Name, interval and origin of each of its own checks, if the part is right."""
        checks = self.checks if self.verdict == RIGHT else ()
        return [[check.quantity, check.interval(3), check.origin] for check in checks]


@dataclass(frozen=True, eq=False)
class Cell:
    """Result of a case with a preset."""

    case: HardCase
    preset: str
    parts: tuple[Part, ...]

    @property
    def verdict(self) -> str:
        """The worst verdict of the parts."""
        return max((part.verdict for part in self.parts), key=(RIGHT, REFUSED, WRONG).index, default=WRONG)

    @property
    def message(self) -> str:
        """The messages of the parts that are not right."""
        return "; ".join(f"{part.name}: {part.message}" for part in self.parts if part.verdict != RIGHT)

    @property
    def unaccepted(self) -> tuple[Part, ...]:
        """Parts that are wrong, or refused although neither the case nor the paper's scheme allows it."""
        refusable = self.case.parts if self.preset == LENIENT else self.case.refusable
        return tuple(part for part in self.parts if part.verdict == WRONG
                     or part.verdict == REFUSED and part.name not in refusable)

    def as_row(self) -> dict:
        """The cell in plain types for the pages: case, verdicts, messages, and the intervals of the right parts."""
        case = self.case
        parts = [{"name": part.name, "verdict": part.verdict, "accepted": part not in self.unaccepted,
                  "bounds": part.bounds} for part in self.parts]
        return {"case": {"number": case.number, "id": case.full_id, "title": case.title, "right_is": case.right_is,
                         "failure_is": case.failure_is, "may_refuse": list(case.refusable)},
                "preset": self.preset, "verdict": self.verdict, "accepted": not self.unaccepted,
                "message": self.message, "parts": parts}


def run_cell(case: HardCase, preset: str) -> Cell:
    """Run every part of a case with a preset."""
    return Cell(case, preset, tuple(run_part(name, function, preset) for name, function in case.parts.items()))


def run_part(name: str, function, preset: str, limit: float = LIMIT) -> Part:
    """Run one part and judge it."""
    try:
        with np.errstate(all="raise", under="ignore"), limited(limit):
            items = tuple(flat(function(preset)))
            checks = tuple(item for item in items if isinstance(item, Check))
            always = tuple(check for item in items if isinstance(item, Run) for check in sound(item))
    except (SimulationError, StageError, SceneError) as error:
        has_reason = bool(REASON.search(str(error)))
        message = f"{error}" if has_reason else f"refused without a reason: {error}"
        return Part(name, REFUSED if has_reason else WRONG, message)
    except Exception as error:
        return Part(name, WRONG, f"{type(error).__name__}: {error}")
    return judge_part(name, checks, always)


def judge_part(name: str, checks: tuple[Check, ...], always: tuple[Check, ...]) -> Part:
    """Judge a part: right if it has checks and all of them hold."""
    short = (f"{c.quantity} {c.measured} (expected {c.interval()})" for c in (*checks, *always) if not c.holds)
    message = "; ".join(short) if checks or always else "nothing was measured"
    return Part(name, WRONG if message else RIGHT, message, checks, always)


@contextmanager
def limited(seconds: float):
    """Raise TooLong in the block once the process has used so many CPU seconds."""
    def stop(*_):
        raise TooLong(f"not done after {seconds:g} s")

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


def evidence(cell: Cell) -> Iterator[Check]:
    """Checks of a cell.

    These are the own checks of the right parts, the largest share of a tolerance that the checks of every run use, and
    the number of parts whose verdict the case does not accept.
    """
    right = [part for part in cell.parts if part.verdict == RIGHT]
    for part in right:
        yield from (replace(check, quantity=f"{part.name}, {check.quantity}") for check in part.checks)
    always = [check.used for part in right for check in part.always]
    yield at_most("of what must hold in every run, largest part of a tolerance", max(always, default=0.0), 1.0,
                  "balances, bounds of C, density, area, finite numbers")
    message = f": {cell.message[:300]}" if cell.unaccepted else ""
    yield at_most(f"parts that are wrong, or refused where they may not be{message}", len(cell.unaccepted), 0,
                  "the verdict of the matrix")


def judge(case: HardCase, preset: str, record: Callable, record_property: Callable) -> None:
    """Run a case with a preset, and record its numbers and its cell of the matrix."""
    cell = run_cell(case, preset)
    record_property("cell", cell.as_row())
    record(evidence(cell))


def parametrize(*cases: HardCase) -> pytest.MarkDecorator:
    """Parametrize a test over "case" and "preset". Each hard case is a verification case, and each preset a variant."""
    sets = [pytest.param(case, preset, id=f"{case.full_id}, {preset}", marks=(pytest.mark.slow, case.mark))
            for case in cases for preset in PRESETS]
    return pytest.mark.parametrize("case, preset", sets)


NORM = "numbers of each part with all presets; refused parts are left out"
