"""One run of a sweep: made beside its place and moved there at its end.

So none is half there, or there twice.
"""

from __future__ import annotations

import json
import os
import shutil
import traceback
from importlib.metadata import version
from pathlib import Path

from repro.errors import SimulationError
from repro.run.checkpoint import NEWEST, PREVIOUS
from repro.run.machine import source_hash
from repro.run.running import OutputError, resume, run
from repro.run.whole import lacking
from repro.scene import Scene, SceneError, scene_hash


def code() -> str:
    """What the numbers of a run come from: this package's version and source."""
    return f"{version('dupin2001-repro')}-{source_hash()}"


def ran(folder: Path) -> str | None:
    """The hash of the scene whose run is in a folder, None where there is none that tells it."""
    try:
        return str(json.loads((folder / "run.json").read_text(encoding="utf-8"))["hash"])
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None


def make(scene: Scene, folder: Path, beside: Path) -> str:
    """Run a scene in `beside`, or go on with it there, then move it to `folder`.

    Returns how it ended, in one line, whatever the trouble is.
    """
    if not _begun(scene, beside):
        shutil.rmtree(beside, ignore_errors=True)
    try:
        ended = _made(scene, beside)
        _place(scene, beside, folder)
    except OSError as error:
        return f"failed: {folder}: {error.strerror or error}"
    return ended


def _begun(scene: Scene, beside: Path) -> bool:
    """Is there a state of this scene's run to go on from?"""
    kept = any((beside / name).is_file() for name in (NEWEST, PREVIOUS))
    return kept and ran(beside) == scene_hash(scene)


def _made(scene: Scene, beside: Path) -> str:
    try:
        return resume(beside) if beside.exists() else run(scene, beside)
    except (SimulationError, OutputError, SceneError) as error:
        return f"failed: {error}"
    except Exception as error:  # a bug is one run's failure, and told whole
        traceback.print_exc()
        return f"failed: {type(error).__name__}: {error}"


def _place(scene: Scene, beside: Path, folder: Path) -> None:
    """Move a run to its place, unless another has finished it meanwhile.

    One that failed gives way.
    """
    if lacking(folder, scene):
        shutil.rmtree(folder, ignore_errors=True)
    try:
        os.rename(beside, folder)
    except OSError:
        if lacking(folder, scene):
            raise
        shutil.rmtree(beside, ignore_errors=True)
