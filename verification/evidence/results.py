"""The results of the cases of a session, and their record ``report/live/measured.json``, which is not committed."""

from __future__ import annotations

import os
import platform
import re
from collections.abc import Iterable
from dataclasses import dataclass, field, fields
from datetime import date
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest

from verification.evidence.checks import Check, Study
from verification.evidence.writing import REPORT, load, save

MEASURED = REPORT / "live" / "measured.json"
PASSES, FAILS = "passes", "FALLS SHORT"
CPUS = Path("/proc/cpuinfo")
PACKAGES = ("numpy", "scipy", "scikit-fem", "shapely", "mmgpy", "fipy", "py-pde", "numba")


def as_row(part: Check | Study) -> dict:
    """A check or a study in plain types, as reports carry it between processes."""
    values = {key.name: getattr(part, key.name) for key in fields(part)}
    return {name: value if isinstance(value, str) else np.asarray(value, float).tolist()
            for name, value in values.items()}


def from_row(row: dict, label: str = "") -> Check | Study:
    """The check or study of a row. The label of its variant is added to the name of the quantity."""
    quantity = f"{row['quantity']}, {label}" if label else row["quantity"]
    arrays = {name: np.array(value) for name, value in row.items() if isinstance(value, list)}
    return (Study if arrays else Check)(**{**row, **arrays, "quantity": quantity})


def shortfall(part: Check | Study) -> str:
    """One line on evidence that does not hold."""
    return f"{part.quantity}: {part.measured}; expected {part.interval()} ({part.origin})"


@dataclass
class Result:
    """The results of a case by the labels of its variants: evidence, the error that stopped a variant, and the cell of
    a hard case. seconds: of all variants together."""

    id: str
    evidence: dict[str, list[Check | Study]] = field(default_factory=dict)
    errors: dict[str, str] = field(default_factory=dict)
    cells: dict[str, dict] = field(default_factory=dict)
    seconds: float = 0.0

    def add(self, report: pytest.TestReport) -> None:
        """Add the report of a variant."""
        properties = dict(report.user_properties)
        label = properties["variant"]
        self.evidence[label] = [from_row(row, label) for row in properties.get("evidence", ())]
        self.seconds += report.duration
        if "cell" in properties:
            self.cells[label] = properties["cell"]
        if report.failed and not self.evidence[label]:
            crash = getattr(report.longrepr, "reprcrash", None)
            self.errors[label] = (crash.message if crash else str(report.longrepr)).strip().splitlines()[0]

    @property
    def measured(self) -> list[Check | Study]:
        """All checks and studies, the studies first."""
        parts = [part for evidence in self.evidence.values() for part in evidence]
        return sorted(parts, key=lambda part: isinstance(part, Check))

    @property
    def holds(self) -> bool:
        """Whether the case has evidence and all of it holds."""
        return bool(self.measured) and not self.errors and all(part.holds for part in self.measured)

    @property
    def verdict(self) -> str:
        """PASSES or FAILS."""
        return PASSES if self.holds else FAILS

    def in_order(self, labels: Iterable[str]) -> Result:
        """Return the result with its variants in the order of the labels."""
        evidence = {label: self.evidence[label] for label in labels}
        cells = {label: self.cells[label] for label in labels if label in self.cells}
        return Result(self.id, evidence, self.errors, cells, self.seconds)


def save_measured(results: Iterable[Result]) -> None:
    """Add the numbers of the cases that ran to the record of this machine."""
    before = load(MEASURED, {"cases": {}})["cases"]
    save({"environment": machine(), "cases": {**before, **{r.id: _numbers(r) for r in results}}}, MEASURED)


def _numbers(result: Result) -> dict:
    messages = {label: cell["message"] for label, cell in result.cells.items() if cell["message"]}
    return {"verdict": result.verdict, "seconds": round(result.seconds, 2),
            "measured": {part.quantity: part.measured for part in result.measured},
            **({"messages": messages} if messages else {})}


def machine() -> dict:
    """The machine and the packages that numbers and times belong to."""
    return {"platform": platform.platform(), "processor": processor(), "cores": os.cpu_count(),
            "python": platform.python_version(), "versions": {name: version(name) for name in PACKAGES},
            "threads": os.environ.get("OMP_NUM_THREADS", "not set"), "date": date.today().isoformat()}


def processor() -> str:
    """The processor's model from Linux, else from Python."""
    text = CPUS.read_text(encoding="utf-8") if CPUS.exists() else ""
    match = re.search("^model name\\s*: (.*)", text, re.MULTILINE)
    return match[1].strip() if match else platform.processor() or "unknown"
