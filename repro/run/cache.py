"""Runs that are computed once: cached by the hash of their scene and of this package's source.

A figure or a claim asks for the run of a scene; whoever asks first computes it, into a folder that
appears whole. A change of the scene or of the code is another key, so a stale number cannot be
shown.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from tempfile import mkdtemp

from repro.results.files import read_sealed
from repro.run.machine import source_hash
from repro.run.running import run
from repro.scene import Scene, scene_hash


def run_folder(scene: Scene, folder: Path) -> Path:
    """Where the cached run of a scene is or will be."""
    return folder / f"{scene.name}-{scene_hash(scene)}-{source_hash()}"


def cached_run(scene: Scene, folder: Path) -> Path:
    """The results folder of a scene's run, computed if it is not there.

    Raises SimulationError where the run fails.
    """
    target = run_folder(scene, folder)
    if (target / "run.json").exists():
        return target
    folder.mkdir(parents=True, exist_ok=True)
    beside = Path(mkdtemp(prefix=".computing-", dir=folder))
    try:
        run(scene, beside / "run")
        try:
            os.replace(beside / "run", target)
        except OSError:
            if not (target / "run.json").exists():  # else another process has been faster
                raise
    finally:
        shutil.rmtree(beside)
    return target


def cached_runs(scenes: Iterable[Scene], folder: Path) -> list[Path]:
    """The results folders of several scenes.

    The missing ones are computed side by side, a process a core.
    """
    scenes = list(scenes)
    wanted = {run_folder(scene, folder): scene for scene in scenes}
    missing = [scene for target, scene in wanted.items() if not (target / "run.json").exists()]
    if len(missing) > 1:
        with ProcessPoolExecutor(max_workers=os.cpu_count()) as pool:
            list(pool.map(cached_run, missing, [folder] * len(missing)))
    return [cached_run(scene, folder) for scene in scenes]


def provenance(folder: Path) -> dict:
    """The ``run.json`` of a run."""
    return read_sealed(folder / "run.json")
