"""What hard cases are made of: runs of scenes, what must hold in every run, and what a preset promises.

When a cell of the matrix, a hard case with a preset, is right, refused or wrong.

right     all checks of its parts hold, and so does what must hold in every run (balances, bounds, finite numbers);
refused   a part has stopped with an error of ``repro``, which says what bound was met or what to change;
wrong     a check fails, another exception is raised, nothing is measured, or a part takes longer than LIMIT.

Every hard case is a verification case whose variants are the presets.
"""

from __future__ import annotations

import re
import signal
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from reference import poiseuille
from repro.errors import SimulationError, StageError
from repro.march.loop import Instant, PoreEnd
from repro.march.simulation import simulate
from repro.model import pore
from repro.model.pore import Pore, Solved, peclet
from repro.results import M_PER_D, row
from repro.scene import Scene, load_scene
from repro.scene.units import SceneError
from verification.kernel.case import Check, Line, Note, at_least, at_most, between, case, flat, largest
from verification.problems.channels import NAMES, pair
from verification.problems.runs import NUMERICS, worth

PRESETS = tuple(NUMERICS)
#: With the paper's scheme any part may be refused.
LENIENT = "paper"
#: Relative error that a preset stands for, in velocity, conductivity, area, thickness and tips, and of effluents over
#: the supply. The paper names none: linear triangles of its sizes were measured 1 to 4 % off in the head loss.
TOLERANCE = {"paper": 0.04, "fast": 0.01, "accurate": 0.001, "cubic": 0.01}
PROMISED = {"paper": "linear triangles: 1 to 4 % in the head loss",
            "fast": "what fast is for: 1 %", "accurate": "what accurate is for: 0.1 %",
            "cubic": "as fast: 1 %"}
#: Bounds of concentrations over the supply that the stages document (UNRESOLVED, OVERSHOOT).
LOWEST, HIGHEST = -1e-3, 1.02
BALANCE = 1e-9
NEWTON = "Newton's tolerance of 1e-12 a row, times the rows, a thousand at least, over Peclet's number where under one"
FIXED = ('growth.end="0 h"',)


@dataclass(frozen=True, eq=False)
class Run(Note):
    """A scene that has run: its instants, their rows in ``timeseries.csv``, and the message of PoreEnd or "".

    balance: what the substrates' balances may miss, None where they say nothing; density: by how much a local
    (X_A + X_I) / X_m may differ from one, more where a film closes at once under the aggregate.
    """

    scene: Scene
    instants: Sequence[Instant]
    rows: Sequence[dict]
    ended: str = ""
    balance: float | None = BALANCE
    density: float = 0.05

    @property
    def end(self) -> Instant:
        """The last instant."""
        return self.instants[-1]

    @property
    def last(self) -> dict:
        """Its row."""
        return self.rows[-1]

    def column(self, name: str) -> np.ndarray:
        """(rows,) of one name."""
        return np.array([row[name] for row in self.rows])

    def over_first(self, name: str = "aggregate_area_um2") -> np.ndarray:
        """(rows,) of one name over the first."""
        return self.column(name) / self.column(name)[0]


@dataclass(frozen=True)
class HardCase:
    """One of the twenty-three: ``parts`` name -> function of the preset, which gives Checks and Runs, or lists of them.

    refusable: names of the parts that may be refused with ``fast`` and ``accurate``, and with ``paper`` all may;
    mutants: ids of wrong changes that it catches.
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
        """That of its verification case."""
        return f"hard-{self.number:02d}-{self.id}"


def scene(name: str, preset: str, *changes: str) -> Scene:
    """A packaged scene with a preset and other changes (KEY=VALUE)."""
    return load_scene(name, (*NUMERICS[preset], *changes))


def ran(made: Scene, way: Callable[[Scene], Iterator[Instant]] = simulate, **how) -> Run:
    """Run a scene to its end, or to the pore's; how: of :class:`Run`."""
    instants, ended = [], ""
    try:
        for instant in way(made):
            instants.append(instant)
    except PoreEnd as end:
        ended = str(end)
    return Run(made, instants, [row(made, instant) for instant in instants], ended, **how)


def run(name: str, preset: str, *changes: str, **how) -> Run:
    """Run a packaged scene with changes."""
    return ran(scene(name, preset, *changes), **how)


@cache
def reference(name: str, *changes: str, refinement: float = 1.0) -> Run:
    """A finer run on curved triangles, whose error is well under that of ``accurate`` (refinement 0.45, 0.001)."""
    return run(name, "accurate", *changes, f"numerics.refinement={refinement}", "numerics.tolerance=0.0005")


def against(name: str, preset: str, changes: Sequence[str], *columns: str, refinement: float = 1.0,
            **how) -> tuple[Run, Run, list]:
    """A run, a finer one, and the checks of the first with what it must share with the other; how: of :class:`Run`."""
    found, fine = run(name, preset, *changes, **how), reference(name, *changes, refinement=refinement)
    return found, fine, [found, *close(found, fine, preset, *columns)]


def close(found: Run, trusted: Run, preset: str, *columns: str, allowed: float = 0.0) -> Iterator[Check]:
    """Columns of the last rows against each other, as the presets promise them: relative, effluents over the supply;
    ``allowed``: where a case has more to allow for."""
    bound = allowed or TOLERANCE[preset]
    origin = f"{PROMISED[preset]}; and what the case allows for" if allowed else PROMISED[preset]
    for column in columns:
        ours, theirs = found.last[column], trusted.last[column]
        size = abs(theirs)
        if column in EFFLUENTS:
            size = getattr(found.scene.substrates, column.split("_")[1]).supply
        yield at_most(f"{column} against a finer run", abs(ours - theirs) / size, bound, origin)


def clean_conductivity(made: Scene) -> float:
    """That of the scene's pore without an aggregate, m/d."""
    drive = made.flow
    return poiseuille.conductivity(made.pore.width, drive.kinematic_viscosity / drive.gravity) * M_PER_D


def alike(told: str, names: Sequence[str], ours: Sequence[float], theirs: Sequence[float], preset: str) -> list[Check]:
    """Numbers against others that may differ by what the preset promises, relative."""
    return [promised(f"{name} {told}", abs(one / other - 1), preset) for name, one, other in zip(names, ours, theirs)]


def promised(quantity: str, value: float, preset: str) -> Check:
    """A relative error that the preset stands for."""
    return at_most(quantity, value, TOLERANCE[preset], PROMISED[preset])


EFFLUENTS = ("effluent_acceptor_mg_per_L", "effluent_donor_mg_per_L")
SHAPE = ("aggregate_area_um2", "thickness_um", "upstream_um", "downstream_um")
DRIVE = ("conductivity_m_per_d",)


def sound(found: Run) -> Iterator[Check]:
    """What holds in every run, whatever it is of: the worst over its instants."""
    yield at_most("numbers that are not finite", unreal(found), 0, "none is")
    if found.scene.substrates:
        yield from _balances(found)
        yield from _bounds(found)
    if found.scene.kinetics:
        yield from _biomass(found)


def unreal(found: Run) -> int:
    """How many numbers of rows and fields are infinite or not a number."""
    count = sum(not np.isfinite(value) for line in found.rows for value in line.values() if value is not None)
    return count + sum(np.count_nonzero(~np.isfinite(values)) for i in found.instants for values in _fields(i))


def _fields(instant: Instant) -> Iterator[np.ndarray]:
    now, solved = instant.pore, instant.solved
    for part in filter(None, (now, now.mesh, now.body, solved.flow, solved.concentrations)):
        yield from (values for values in vars(part).values() if isinstance(values, np.ndarray))


def _balances(found: Run) -> Iterator[Check]:
    if found.balance is None:
        return
    most, origin = found.balance, "the flux is as much smaller than what diffuses"
    if found.balance == BALANCE:
        most, origin = max(BALANCE, 1e-12 * found.last["nodes"] / _slow(found)), NEWTON
    for name in NAMES:
        yield at_most(f"{name} in - out - consumed, over the larger", largest(found.column(f"{name}_balance")), most,
                      origin)


def _slow(found: Run) -> float:
    """What flows over what diffuses, u W / D, one at most: Newton's tolerance is of the larger."""
    speed = (found.last.get("mean_velocity_m_per_d") or 0.0) / 24e-6
    return min(1.0, peclet(found.scene, speed)) if speed else 1.0


def _bounds(found: Run) -> Iterator[Check]:
    supplies = pair("supply", found.scene.substrates)
    for name, supply in zip(NAMES, supplies):
        fields = [getattr(i.solved.concentrations, name) for i in found.instants]
        yield at_least(f"{name}'s least over the supply", min(f.min() for f in fields) / max(supplies), LOWEST,
                       "transport.UNRESOLVED")
        if supply:
            yield at_most(f"{name}'s largest over its supply", max(f.max() for f in fields) / supply, HIGHEST,
                          "transport.OVERSHOOT")


def _biomass(found: Run) -> Iterator[Check]:
    densities = {"least": found.column("biomass_density_min").min(),
                 "largest": found.column("biomass_density_max").max()}
    for which, density in densities.items():
        yield between(f"local density over X_m, {which}", density, 1 - found.density, 1 + found.density, DENSITY)
    yield between("share of X_I", max(found.column("inert_fraction"), key=abs), -1e-12, 1.0, "a share")
    if found.scene.growth:
        whole = found.scene.kinetics.maximum_density
        apart = max(abs(i.pore.mass / whole / i.pore.outline.area - 1) for i in found.instants)
        yield at_most("biomass after - before - made, over after", largest(found.column("biomass_balance")), BALANCE,
                      MEAN)
        yield at_most("area against biomass over X_m", apart, AREA[found.scene.numerics.elements], MEAN)
        if found.scene.numerics.time == "midpoint":
            yield _oxygen_demand(found)


def _oxygen_demand(found: Run) -> Check:
    """Of the midpoint rule alone: the updates take up substrates at the concentrations of a step's ends, and grow with
    rates of both."""
    law = found.scene.kinetics
    missing = [abs(ledger.biomass_made - np.subtract(*worth(law, ledger))) / ledger.biomass_after
               for instant in found.instants for ledger in instant.ledgers]
    return at_most("biomass made less what donor makes and acceptor decays, over the biomass",
                   max(missing, default=0.0), 1e-12, "one integral, in the same points; round-off")


MEAN = "J = theta in the mean; Newton's tolerance"
DENSITY = "J = theta holds in the mean over elements: a local density is off by what an element does not resolve [E7]"
#: Exact on curved triangles, where biomass is kept by its mass; with (34) on straight ones a remesh leaves an error
#: that is worked off at the next update [E7].
AREA = {"linear": 1e-4, "quadratic": 1e-8, "cubic": 1e-8}


def seeded(made: Scene) -> tuple[Pore, Solved]:
    """The pore at t = 0 and what is solved in it."""
    return solved_in(made, pore.seeded(made))


def solved_in(made: Scene, now: Pore) -> tuple[Pore, Solved]:
    """A pore with its concentrations, and what is solved in it."""
    found = pore.solve(made, now)
    return replace(now, concentrations=found.concentrations), found


#: CPU seconds that a part may take: ten times what the longest does.
LIMIT = 200.0
RIGHT = "right"
REFUSED = "refused"
WRONG = "wrong"
#: A refusal must say one of these: what to try, or which bound was met.
REASON = re.compile(r"\b(try|leave|needed|under|above|more than|accepted|outside of)\b")


class TooLong(Exception):
    """A part has taken more than LIMIT."""


@dataclass(frozen=True, eq=False)
class Part:
    """What came of one part: its verdict, why, its own checks, and those of every run in it."""

    name: str
    verdict: str
    message: str
    checks: tuple[Check, ...] = ()
    always: tuple[Check, ...] = ()


@dataclass(frozen=True, eq=False)
class Cell(Note):
    """A case with a preset."""

    case: HardCase
    preset: str
    parts: tuple[Part, ...]

    @property
    def verdict(self) -> str:
        """The worst of the parts'."""
        return max((part.verdict for part in self.parts), key=(RIGHT, REFUSED, WRONG).index, default=WRONG)

    @property
    def message(self) -> str:
        """Why it is not right, part by part."""
        return "; ".join(f"{part.name}: {part.message}" for part in self.parts if part.verdict != RIGHT)

    @property
    def unaccepted(self) -> tuple[Part, ...]:
        """Parts that are neither right nor refused where the case says so, or with the paper's scheme."""
        refusable = self.case.parts if self.preset == LENIENT else self.case.refusable
        return tuple(part for part in self.parts if part.verdict == WRONG
                     or part.verdict == REFUSED and part.name not in refusable)

    def lines(self, every: Sequence[Cell]) -> list[Line]:
        """Verdicts of the parts by preset; then what the right parts were judged by, by preset where that differs."""
        presets = ", ".join(cell.preset for cell in every)
        found = []
        for parts in zip(*(cell.parts for cell in every)):
            fine = all(part not in cell.unaccepted for cell, part in zip(every, parts))
            found.append((f"verdict of {parts[0].name}", ", ".join(part.verdict for part in parts), presets, fine))
        bounds: dict[str, list[Check]] = {}
        for part in (part for cell in every for part in cell.parts if part.verdict == RIGHT):
            for check in part.checks:
                bounds.setdefault(f"{part.name}, {check.quantity}", []).append(check)
        for name, of in bounds.items():
            found.append((name, _each(check.accepted for check in of), _each(check.origin for check in of), True))
        return found


def _each(words: Iterable[str]) -> str:
    """Once if all presets have the same."""
    return "; ".join(dict.fromkeys(words))


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
        said = bool(REASON.search(str(error)))
        return Part(name, REFUSED if said else WRONG, f"{error}" if said else f"refused without a reason: {error}")
    except Exception as error:
        return Part(name, WRONG, f"{type(error).__name__}: {error}")
    return judged(name, checks, always)


def judged(name: str, checks: tuple[Check, ...], always: tuple[Check, ...]) -> Part:
    """Right if there are checks and all of them hold."""
    short = (f"{c.quantity} {c.measured} (expected {c.expected})" for c in (*checks, *always) if not c.holds)
    told = "; ".join(short) if checks or always else "nothing was measured"
    return Part(name, WRONG if told else RIGHT, told, checks, always)


@contextmanager
def limited(seconds: float):
    """Raises TooLong inside when the process has spent so many CPU seconds."""
    def stop(*_):
        raise TooLong(f"not done after {seconds:g} s")

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


def measured(one: HardCase, preset: str) -> Iterator[Check | Cell]:
    """Of a case with a preset: all own checks of the parts that are right; what must hold in every run, folded into one
    number; how many parts have a verdict that they may not have; and the cell."""
    cell = run_cell(one, preset)
    right = [part for part in cell.parts if part.verdict == RIGHT]
    for part in right:
        yield from (replace(check, quantity=f"{part.name}, {check.quantity}") for check in part.checks)
    always = [check.used for part in right for check in part.always]
    yield at_most("of what must hold in every run, largest part of a tolerance", max(always, default=0.0), 1.0,
                  "balances, bounds of C, density, area, finite numbers")
    told = f": {cell.message[:300]}" if cell.unaccepted else ""
    yield at_most(f"parts that are wrong, or refused where they may not be{told}", len(cell.unaccepted), 0,
                  "the verdict of the matrix")
    yield cell


def register(cases: Iterable[HardCase]) -> None:
    """Make them known to ``python -m verification``, a variant a preset."""
    for one in cases:
        claim = f"{one.title}: {one.right_is[0].lower()}{one.right_is[1:]}"
        case(one.full_id, kind="property", claim=claim, norm=NORM, mutants=one.mutants, slow=True,
             over={preset: (one, preset) for preset in PRESETS}, ways="1 2")(measured)


NORM = "numbers of each part with all presets, and with fast on cubic elements; refused parts are left out"
