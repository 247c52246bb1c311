"""Packages that a run needs, and the conditions on which its numbers depend besides the scene."""

import hashlib
import os
import platform
import re
from contextlib import suppress
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from repro.errors import PackageMissing
from repro.fem.linear import Method
from repro.scene import Scene, SceneError
from repro.scene.units import alike

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
#: The packages that compute the numbers of a run.
ROOMS = ("schemes", "scene", "fem", "model", "march", "results")
#: A comment, or a string, which may look like one. Each alternative begins with a fixed character.
REMARK = re.compile(r"""
    \#[^\n]*
    | \"{3}[^"\\]*(?:(?:\\.|\"{1,2}(?!\"))[^"\\]*)*\"{3}
    | '{3}[^'\\]*(?:(?:\\.|'{1,2}(?!'))[^'\\]*)*'{3}
    | \"[^"\\\n]*(?:\\.[^"\\\n]*)*\"
    | '[^'\\\n]*(?:\\.[^'\\\n]*)*'
    """, re.VERBOSE | re.DOTALL)


def refuse_exchanged(scene: object) -> None:
    """Raise SceneError if a loaded scene has another scheme than its preset: no file states it."""
    if isinstance(scene, Scene) and scene.numerics.exchanged is not None:
        raise SceneError(f"{scene.name}: a run in a folder has the scheme of numerics.preset; "
                         "repro.solve and repro.simulate take another scheme")


def require_packages(scene: Scene) -> None:
    """Raise SceneError if a scene needs an optional package that is not installed."""
    try:
        Method(scene.numerics.solver).checked()
    except PackageMissing as error:
        raise SceneError(f'{scene.name}: numerics.solver = "{scene.numerics.solver}": {error}, or '
                         "leave the key out") from None


@cache
def source_hash() -> str:
    """Hash (8 hexadecimal digits) of the source that computes numbers, without docstrings and
    comments."""
    digest = hashlib.sha256()
    package = Path(__file__).parents[1]
    paths = [path for room in ROOMS for path in (package / room).rglob("*.py")]
    for path in sorted(paths):
        name = path.relative_to(package).as_posix()
        digest.update(name.encode() + statements(path.read_text(encoding="utf-8")).encode())
    return digest.hexdigest()[:8]


def statements(source: str) -> str:
    """Source text without comments and empty lines, with ``...`` for each docstring."""
    lines = REMARK.sub(_without_remark, source).split("\n")
    return "\n".join(line.rstrip() for line in lines if line.strip())


def _without_remark(match: re.Match) -> str:
    """Replace a comment by nothing, and a string that fills its lines by an ellipsis."""
    text = match[0]
    if text.startswith("#"):
        return ""
    before = match.string[:match.start()].rpartition("\n")[2]
    after = match.string[match.end():].partition("\n")[0]
    return "..." if text.startswith('"""') and not (before + after).strip() else text


def conditions() -> dict:
    """Conditions of a run, for ``run.json``; equal conditions give equal bits."""
    built: Any = np.show_config(mode="dicts")
    blas = built["Build Dependencies"]["blas"]
    optional = {}
    with suppress(PackageNotFoundError):
        optional["pypardiso"] = version("pypardiso")
    return {"system": platform.system(), "machine": platform.machine(),
            "libc": " ".join(platform.libc_ver()), "blas": f"{blas['name']} {blas['version']}",
            "simd": built["SIMD Extensions"].get("found", []),
            "geos": shapely.geos_version_string, "source": source_hash(), "optional": optional,
            "threads": {name: os.environ[name] for name in THREADS if name in os.environ}}


def differences(before: dict, after: dict) -> dict[str, list]:
    """{key: [before, after]} of all values that differ; keys of nested tables are dotted."""
    changes: dict[str, list] = {}
    for key in sorted(before.keys() | after.keys()):
        old, new = before.get(key), after.get(key)
        if isinstance(old, dict) and isinstance(new, dict):
            changes |= {f"{key}.{nested}": pair for nested, pair in differences(old, new).items()}
        elif not alike(old, new):
            changes[key] = [old, new]
    return changes
