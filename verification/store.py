"""Stores of results that are computed once for a scene and for the present source of ``repro``.

The key of a result contains the hashes of the scene and of the source, so a change of either recomputes the result.
Missing results are computed in parallel. :class:`Folders` stores whole runs, :class:`Numbers` the few numbers of many
runs, and :class:`Memory` the return values of the functions of claims, until the process ends.
"""

import os
import shutil
from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable, Iterable
from concurrent.futures import ProcessPoolExecutor
from functools import partial, wraps
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

from repro.results.files import read_sealed
from repro.runs.execution import run
from repro.runs.machine import source_hash
from repro.scene import Scene, scene_hash
from verification.evidence.writing import append, lines


def key_of(scene: Scene) -> str:
    """The key of a scene's results with the present source."""
    return f"{scene.name}-{scene_hash(scene)}-{source_hash()}"


def map_in_parallel(function: Callable, *arguments: Iterable) -> list:
    """Like map, on one process per core."""
    with ProcessPoolExecutor() as pool:
        return list(pool.map(function, *arguments))


class Store(ABC):
    """Results of scenes, each computed once, by a function that processes can share."""

    def __init__(self, compute: Callable[[Scene], Any]):
        self.compute = compute

    @abstractmethod
    def find(self, key: str) -> Any:
        """The result of a key, or None."""

    @abstractmethod
    def keep(self, key: str, result: Any) -> None:
        """Store a computed result."""

    def get(self, scene: Scene) -> Any:
        """The result of a scene."""
        return self.get_all([scene])[0]

    def get_all(self, scenes: Iterable[Scene]) -> list:
        """The results of several scenes. If more than one is missing, they are computed in parallel."""
        keyed = [(key_of(scene), scene) for scene in scenes]
        missing = {key: scene for key, scene in keyed if self.find(key) is None}
        compute_all = map_in_parallel if len(missing) > 1 else map
        for key, result in zip(missing, compute_all(self.compute, missing.values())):
            self.keep(key, result)
        return [self.find(key) for key, _ in keyed]


class Folders(Store):
    """Whole runs, a folder each."""

    def __init__(self, folder: Path):
        super().__init__(partial(_run_into, folder))
        self.folder = folder

    def path(self, scene: Scene) -> Path:
        """The folder of a scene's run, which may not exist yet."""
        return self.folder / key_of(scene)

    def find(self, key: str) -> Path | None:
        """The folder of a run, or None."""
        return self.folder / key if (self.folder / key / "run.json").exists() else None

    def keep(self, key: str, result: Path) -> None:
        """Do nothing: the computation has stored the run in its folder."""


def _run_into(folder: Path, scene: Scene) -> Path:
    """Run a scene into a folder that appears complete. Raises SimulationError if the run fails."""
    target = folder / key_of(scene)
    folder.mkdir(parents=True, exist_ok=True)
    temporary = Path(mkdtemp(prefix=".computing-", dir=folder))
    try:
        run(scene, temporary / "run")
        try:
            os.replace(temporary / "run", target)
        except OSError:
            if not (target / "run.json").exists():  # else another process was faster
                raise
    finally:
        shutil.rmtree(temporary)
    return target


def provenance(folder: Path) -> dict:
    """The ``run.json`` of a run."""
    return read_sealed(folder / "run.json")


class Numbers(Store):
    """Numbers {name: value} of many runs, in the lines of a file."""

    def __init__(self, numbers: Callable[[Scene], dict[str, float]], file: Path):
        super().__init__(partial(_append_numbers, numbers, file))
        self.known = {row["run"]: row["numbers"] for row in lines(file) if row["run"].endswith(source_hash())}

    def find(self, key: str) -> dict[str, float] | None:
        """The numbers of a run, or None."""
        return self.known.get(key)

    def keep(self, key: str, result: dict[str, float]) -> None:
        """Store the numbers in memory."""
        self.known[key] = result


def _append_numbers(numbers: Callable[[Scene], dict[str, float]], file: Path, scene: Scene) -> dict[str, float]:
    """Compute the numbers of a run and write them at once, so that an interruption loses only the runs in progress."""
    row = {"run": key_of(scene), "numbers": numbers(scene)}
    append(row, file)
    return row["numbers"]


class Memory:
    """Results of functions in this process, by their arguments and the present context."""

    def __init__(self, context: Callable[[], Hashable]):
        self._context = context
        self._results: dict[Hashable, dict] = {}

    def cached(self, function: Callable) -> Callable:
        """Decorate a function: each call is computed once in each context."""
        @wraps(function)
        def wrapper(*arguments):
            results = self._results.setdefault(self._context(), {})
            if (function, arguments) not in results:
                results[function, arguments] = function(*arguments)
            return results[function, arguments]
        return wrapper

    def forget(self, context: Hashable) -> None:
        """Drop the results of a context."""
        self._results.pop(context, None)
