"""The runs that the figures are drawn from: what is asked for, in one place, and where the results are."""

from __future__ import annotations

import shlex
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from repro import Scene, load_scene
from repro.run.cache import cached_run, cached_runs

CACHE = Path(__file__).parent / "cache"


@dataclass(frozen=True)
class Request:
    """A packaged scene with what `--set` changes in it."""

    scene: str
    overrides: tuple[str, ...] = ()

    def load(self) -> Scene:
        """The scene, read and checked."""
        return load_scene(self.scene, self.overrides)

    def command(self) -> str:
        """What to type for the same run."""
        changes = [part for change in self.overrides for part in ("--set", change)]
        return shlex.join(["repro", "run", self.scene, "--out", f"runs/{self.scene}", *changes])


def _times(*hours: float) -> str:
    return "output.times=[" + ", ".join(f'"{hour:g} h"' for hour in hours) + "]"


#: Section 4; with times given, a run also writes its fields as they are before each of them's expansion (Plate 1).
BASE = Request("base", (_times(*range(1, 20), 19.2, 19.4),))
#: Figure 6, every shape update.
WIDE = Request("wide")
#: Figure 4, geometry and mesh only.
INITIAL_MESH = Request("initial_mesh")


def base_run() -> Path:
    """Results folder of Base."""
    return cached_run(BASE.load(), CACHE)


def wide_run() -> Path:
    """Results folder of Wide."""
    return cached_run(WIDE.load(), CACHE)


def initial_mesh_run() -> Path:
    """Results folder of the geometry of Base at t = 0."""
    return cached_run(INITIAL_MESH.load(), CACHE)


def folders(requests: Iterable[Request]) -> list[Path]:
    """Results folders of several requests, the missing ones computed side by side."""
    return cached_runs([request.load() for request in requests], CACHE)
