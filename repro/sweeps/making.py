"""A whole sweep: what is wanted, made, and told; for scripts and for ``repro sweep``."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from repro.runs.machine import require_packages
from repro.scene import Source, label
from repro.sweeps import cluster, design, page, pool, table
from repro.sweeps.state import Sweep, opened, usable

#: Of the first conductivity, at which a pore counts as clogged.
CLOGGED = 0.1
#: Is told what happens: {"event": "start" or "run", "done": runs, "total": runs, ...}.
Tell = Callable[[dict[str, Any]], None]


@dataclass(frozen=True, eq=False)
class Swept:
    """The runs of a sweep: ``runs`` has what ``runs.csv`` has and more; ``folder`` is where they
    are, :func:`repro.load_run` reads one of ``paths``."""

    source: str
    folder: Path
    factors: list[design.Factor]
    runs: list[table.Told]

    @property
    def paths(self) -> list[Path]:
        """The folder of each run."""
        return [self.folder / "runs" / one.point.name for one in self.runs]

    @property
    def failed(self) -> list[table.Told]:
        """The runs that have not come to their end."""
        return [one for one in self.runs if not one.done]

    def label(self, one: table.Told) -> str:
        """What a run has of each key that is varied, for people to read."""
        return design.label(self.factors, one.point.values)

    def __repr__(self) -> str:
        return (f"<Sweep of {self.source}: {len(self.runs) - len(self.failed)} of {len(self.runs)} "
                f"runs done, in {self.folder}>")


def untold(event: dict[str, Any]) -> None:
    """What is done with events where nobody asks for them."""


def sweep(source: Source, vary: Sequence[str], folder: str | Path, overrides: Sequence[str] = (),
          unset: Sequence[str] = (), *, samples: int | None = None, seed: int = 0,
          workers: int | None = None, scheduler: str | None = None, clogged: float = CLOGGED,
          tell: Tell = untold) -> Swept:
    """Make runs of a scene, a file, a packaged name or a dict, with keys varied, into a folder.

    vary: entries such as "flow.mean_velocity=0.3:30 m/day:log:8" or "pore.width=50 um, 60 um", as
    of ``repro sweep --vary``; samples: of a Latin hypercube instead of a grid; workers: runs at a
    time, on all cores by default, or on the workers of a Dask ``scheduler``; clogged: the part of
    the first conductivity at which a pore counts as clogged.

    What is there is not made again. Runs that fail are told as such. Raises SceneError where a
    scene is not accepted, OutputError where the folder cannot be used.
    """
    ended: dict[int, str] = {}
    factors = [design.parse(text) for text in vary]
    found = design.grid(factors) if samples is None else design.latin(factors, samples, seed)
    with _ready(scheduler, min(workers or pool.cores(), len(found))) as each:
        points = design.points(source, list(overrides), factors, found, unset)
        for point in points if scheduler is None else ():
            require_packages(point.scene)
        wanted = Sweep(Path(folder), label(source), factors, points)
        with opened(wanted):
            try:
                _make(wanted, each, ended, tell)
            finally:
                told = _told(wanted, ended, clogged)
    return Swept(wanted.source, wanted.folder, factors, told)


def _ready(scheduler: str | None, workers: int) -> AbstractContextManager[pool.Each]:
    """What makes the runs: processes here, which load what they need meanwhile, or a cluster."""
    return cluster.ready(scheduler) if scheduler else pool.ready(workers)


def _make(wanted: Sweep, each: pool.Each, ended: dict[int, str], tell: Tell) -> None:
    """Make what is missing; `ended` gets how each run ended, by number."""
    missing = wanted.missing()
    total = len(wanted.points)
    before = total - len(missing)
    tell({"event": "start", "scene": wanted.source, "done": before, "total": total})
    for point, status in _each(missing, wanted.runs, each):
        ended[point.index] = status
        tell({"event": "run", "done": before + len(ended), "total": total, "run": point.index,
              "values": design.label(wanted.factors, point.values), "status": status})


def _each(missing: list[design.Point], runs: Path,
          each: pool.Each) -> Iterator[tuple[design.Point, str]]:
    if missing:
        yield from each(missing, runs)


def _told(wanted: Sweep, ended: dict[int, str], clogged: float) -> list[table.Told]:
    """What there is now, which is written as tables and page too."""
    told = table.tell(wanted, ended, clogged)
    with usable(wanted.folder):
        table.write(wanted, told)
        page.write(wanted, told, clogged)
    return told
