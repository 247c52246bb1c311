"""`manifest.json`: what `make figures` has made, by the SHA-256 of its data, with wall times and versions.

Pictures are listed by name and size; what is hashed is the data that they are drawn from: the files of each run, and
what each figure draws. Fields are hashed as arrays, so that a file that is only packed otherwise is the same.
`python -m paper_figures.manifest` is `make check-manifest`: it hashes what is there anew and compares that first with
what `make figures` has written beside the pictures (a difference is a file that was altered since), then with the
committed copy (a difference is another computation, and the environments are compared to say why).
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import sys
from collections.abc import Iterable, Iterator
from importlib import import_module
from importlib.metadata import version
from pathlib import Path

import meshio
import numpy as np
from matplotlib.figure import Figure

from paper_figures import FIGURES, runs, states
from repro.results import PACKAGES
from repro.run.cache import provenance, run_folder
from repro.run.machine import source_hash
from verification.bench.record import processor

OUT = Path(__file__).parent / "out"
COMMITTED = Path(__file__).parent / "manifest.json"
NAME = "manifest.json"
#: Of a run's files, those without data: they hold times of day, or index the others.
NOT_DATA = ("run.json", "report.html")


def environment() -> dict[str, str]:
    """What could change the bits of a result: the source, the versions, the machine and its linear algebra."""
    blas = np.show_config(mode="dicts")["Build Dependencies"]["blas"]
    return {"source": source_hash(), "python": platform.python_version(),
            **{name: version(name) for name in (*PACKAGES, "matplotlib")},
            "blas": f"{blas['name']} {blas['version']}", "threads": os.environ.get("OMP_NUM_THREADS", "not set"),
            "system": f"{platform.system()} {platform.machine()}", "processor": processor()}


def file_hash(path: Path) -> str:
    """SHA-256 of a file's data: of the arrays of a `.vtu`, of the text of any other."""
    if path.suffix != ".vtu":
        return hashlib.sha256(path.read_bytes()).hexdigest()
    content = meshio.read(path)
    named = {"points": content.points, **{f"cells {b.type}": b.data for b in content.cells},
             **content.point_data, **{name: values[0] for name, values in content.cell_data.items()}}
    return data_hash((name, np.asarray(named[name])) for name in sorted(named))


def data_hash(parts: Iterable[tuple[str, np.ndarray]]) -> str:
    """SHA-256 of named arrays: names, types, shapes and values."""
    digest = hashlib.sha256()
    for name, values in parts:
        digest.update(f"{name} {values.dtype.str} {values.shape}\n".encode())
        digest.update(np.ascontiguousarray(values).tobytes())
    return digest.hexdigest()


def figure_hash(made: Figure, caption: str) -> str:
    """SHA-256 of what a figure draws, in the coordinates of its data, and says."""
    return data_hash([*_drawn(made), ("caption", np.frombuffer(caption.encode(), np.uint8))])


def _drawn(made: Figure) -> Iterator[tuple[str, np.ndarray]]:
    for axes in made.axes:
        yield "limits", np.array([*axes.get_xlim(), *axes.get_ylim()])
        for line in axes.lines:
            yield "line", np.asarray(line.get_xydata(), float)
        for patch in axes.patches:
            yield "patch", np.asarray(patch.get_path().vertices, float)
        for many in axes.collections:
            yield "offsets", np.ma.filled(np.ma.asarray(many.get_offsets(), float), np.nan)
            held = many.get_array()
            yield "values", np.ma.filled(np.ma.asarray([] if held is None else held, float), np.nan)
            for path in many.get_paths():
                yield "path", np.asarray(path.vertices, float)
        words = "\n".join(text.get_text() for text in (axes.title, axes.xaxis.label, axes.yaxis.label, *axes.texts))
        yield "words", np.frombuffer(words.encode(), np.uint8)


def of_run(request: runs.Request, folder: Path) -> dict:
    """What is told of a run: how to make it, how long it took, its last row, and its files."""
    told = provenance(folder)
    files = sorted(path for path in folder.rglob("*") if path.is_file() and path.name not in NOT_DATA)
    last = {name: float(column[-1]) for name, column in states.series(folder).items() if np.isfinite(column[-1])}
    return {"command": request.command(), "scene": told["hash"], "status": told["status"],
            "wall_time_s": told["wall_time_s"], "last_row": last,
            "files": {path.relative_to(folder).as_posix(): file_hash(path) for path in files}}


def of_figure(module, data: str, seconds: float, pictures: Iterable[Path]) -> dict:
    """What is told of a figure: what it is drawn from, what it draws, how long that took, its pictures (bytes)."""
    return {"title": module.TITLE, "runs": [request.scene for request in module.RUNS], "data": data,
            "wall_time_s": seconds, "pictures": {path.name: path.stat().st_size for path in sorted(pictures)}}


def differences(ours: dict, theirs: dict) -> list[str]:
    """What differs in the data of two manifests, a line each; wall times and sizes of pictures are no data."""
    mine, other = _data(ours), _data(theirs)
    return [f"{name}: {_instead(mine.get(name), other.get(name))}" for name in sorted({*mine, *other})
            if mine.get(name) != other.get(name)]


def _data(manifest: dict) -> dict[str, str]:
    """Hash of everything that has one, by a name that says where it is; of pictures, that they are there."""
    found: dict[str, str] = {}
    for name, run in manifest["runs"].items():
        found |= {f"{name}/{file}": digest for file, digest in run["files"].items()} | {f"{name} (scene)": run["scene"]}
    for name, figure in manifest["figures"].items():
        found |= {f"{name} (drawn)": figure["data"]} | dict.fromkeys(figure["pictures"], "a picture")
    return found


def _instead(mine: str | None, other: str | None) -> str:
    if mine is None or other is None:
        return "missing" if mine is None else "not expected"
    return f"{mine[:12]}... instead of {other[:12]}..."


def reasons(ours: dict, theirs: dict) -> list[str]:
    """Where two manifests' environments differ."""
    mine, other = ours["environment"], theirs["environment"]
    return [f"{name}: {mine.get(name)} instead of {other.get(name)}" for name in sorted({*mine, *other})
            if mine.get(name) != other.get(name)]


def apart(ours: dict, theirs: dict) -> dict[str, tuple[float, str]]:
    """By run: the largest relative difference of a number of the last row, and its name."""
    found = {}
    for run in set(ours["runs"]) & set(theirs["runs"]):
        mine, other = ours["runs"][run]["last_row"], theirs["runs"][run]["last_row"]
        found[run] = max((abs(mine[name] - other[name]) / max(abs(other[name]), np.finfo(float).tiny), name)
                         for name in set(mine) & set(other) if not name.endswith("_balance"))
    return found


def present() -> dict:
    """Data of what is there, hashed anew. Raises FileNotFoundError where `make figures` has not been run."""
    modules = {name: import_module(f"paper_figures.{name}") for name in FIGURES}
    found = {request: run_folder(request.load(), runs.CACHE) for module in modules.values() for request in module.RUNS}
    for folder in found.values():
        if not (folder / "run.json").exists():
            raise FileNotFoundError(f"{folder}: no such run of the present source; `make figures` computes it")
    return {"environment": environment(),
            "runs": {request.scene: of_run(request, folder) for request, folder in found.items()},
            "figures": {name: _present_figure(name, module, [found[request] for request in module.RUNS])
                        for name, module in modules.items()}}


def _present_figure(name: str, module, folders: list[Path]) -> dict:
    data = figure_hash(module.draw(*folders), module.caption(*folders))
    return of_figure(module, data, 0.0, OUT.glob(f"{name}.*"))


def check(now: dict, written: dict, committed: dict) -> list[str]:
    """What `make check-manifest` says of what is there, what `make figures` wrote, and the committed copy."""
    told = [f"altered since make figures wrote it: {line}" for line in differences(now, written)]
    other = differences(written, committed)
    if other:
        told += [f"not the committed data: {line}" for line in other]
        told += [f"the environment differs: {line}" for line in reasons(written, committed)] or [
            "the environment is the committed one: the difference is not explained by it"]
        told += [f"{run}, last row: at most {value:.1e} apart, relative ({name})"
                 for run, (value, name) in sorted(apart(written, committed).items())]
    return told


def main() -> int:
    """Entry point; the exit status: 0 where everything is as committed, 1 where anything is not or is missing."""
    try:
        written, committed = (json.loads(path.read_text(encoding="utf-8")) for path in (OUT / NAME, COMMITTED))
        now = present()
    except FileNotFoundError as error:
        print(f"check-manifest: {error}", file=sys.stderr)
        return 1
    told = check(now, written, committed)
    print("\n".join(told) if told else f"{len(_data(now))} outputs: as committed in {COMMITTED.name}")
    return 1 if told else 0


if __name__ == "__main__":
    sys.exit(main())
