"""``bench.json``: what the last benchmark has measured, for tables, pictures and pages.

    {"machine": {"platform", "processor", "cores", "python", "versions": {package: version}, "repeats": {part: number},
                 "import_seconds": {package: s}, "date"},
     "parts": {name: {"title": what is measured, in words,
                      "error": what the error is,
                      "reference": where the reference comes from, and how converged it is,
                      "lines": [{"method": name,
                                 "points": [{"label": sizes and steps, "seconds": median wall time, "cpu": median
                                             processor time, "error": relative, "repeats": number, ...}],
                                 "failed": [{"label": ..., "reason": ...}]}],
                      "apart": [{"what": ..., "seconds": ...}],        times that no point includes
                      ...}},                                           what is a part's own
     "verdicts": [{"claim": ..., "measured": ..., "wanted": ..., "holds": true, false or null (not measured)}]}

What a part has of its own: points of flow, transport, growth and transfer "nodes", those of transfer "drift" (of the
total) and "beyond" (the field's bounds), those of base "nodes", "errors" (of the eight numbers, the larger of both
times) and "stages" {stage: s}; base "wide" [{"preset", "seconds", "cpu", "steps", "end"}] and, kept from one benchmark
to the next, "reference_values" [time][number]; size, whose points have no error, "stages", "ratio" (to the floor) and
"memory_MB" of each, and "fits" {method: {stage: exponent}}; scenes "rows" [{"scene", "method", "seconds", "cpu",
"stages": {stage: s}, ...}] and "steps" [{"method", "seconds", "hours"}]; memory "rows" [{"method", "steps", "slope",
"bound", ...}]. A part that was not run again keeps what it had. Not-a-number is never written.
"""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
from datetime import date
from importlib.metadata import version
from pathlib import Path
from statistics import median
from time import perf_counter

FOLDER = Path(__file__).parents[1] / "report"
FILE = FOLDER / "bench.json"
PACKAGES = ("numpy", "scipy", "scikit-fem", "shapely", "mmgpy", "fipy", "py-pde", "numba")
#: What a user imports to run a scene here, or a problem there.
IMPORTED = {"dupin2001-repro": "repro.march.simulation", "fipy": "fipy", "py-pde": "pde", "scikit-fem": "skfem"}
IMPORTS = 3


def empty() -> dict:
    """A record of nothing."""
    return {"machine": {}, "parts": {}, "verdicts": []}


def load(file: Path = FILE) -> dict:
    """The record of the last benchmark, an empty one where there is none."""
    if not file.exists():
        return empty()
    return json.loads(file.read_text(encoding="utf-8"))


def save(record: dict, file: Path = FILE) -> None:
    """Write a record whole or not at all; ValueError where it holds not-a-number."""
    file.parent.mkdir(parents=True, exist_ok=True)
    beside = file.with_name(f".{file.name}.part")
    beside.write_text(json.dumps(record, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    os.replace(beside, file)


def machine() -> dict:
    """What the times are of; the rest is filled in by the parts."""
    return {"platform": platform.platform(), "processor": processor(), "cores": os.cpu_count(),
            "python": platform.python_version(), "versions": {name: version(name) for name in PACKAGES},
            "threads": os.environ.get("OMP_NUM_THREADS", "not set"), "date": date.today().isoformat()}


def processor(file: Path = Path("/proc/cpuinfo")) -> str:
    """The processor's model, as Linux names it or else as Python does."""
    try:
        lines = file.read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or "unknown"
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or "unknown"


def import_seconds(times: int = IMPORTS) -> dict[str, float]:
    """Median seconds that a new process takes to import each package, less what it takes to import nothing."""
    bare = median(_started("pass") for _ in range(times))
    return {name: max(0.0, median(_started(f"import {module}") for _ in range(times)) - bare)
            for name, module in IMPORTED.items()}


def _started(statement: str) -> float:
    start = perf_counter()
    subprocess.run([sys.executable, "-c", statement], check=True, capture_output=True)
    return perf_counter() - start


def merged(record: dict, parts: dict, repeats: dict, imports: dict | None = None) -> dict:
    """The record with new parts in place of those of the same names; verdicts are to be worked out again."""
    before = record.get("machine", {})
    about = {**machine(), "repeats": {**before.get("repeats", {}), **repeats},
             "import_seconds": imports or before.get("import_seconds", {})}
    return {"machine": about, "parts": {**record.get("parts", {}), **parts}, "verdicts": []}


def line(part: dict, method: str) -> dict | None:
    """The line of a method in a part, None where it has none."""
    return next((found for found in part.get("lines", ()) if found["method"] == method), None)
