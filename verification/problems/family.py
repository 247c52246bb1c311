"""Practical pores, drawn by seed, far past contact. Each reaches its end, the pore's end, or a confirmed fold.

    python -m verification.problems.family --first 0 --count 20 --limit 120

Each member is a process of its own: `repro run` with the preset fast and a limit of processor time. A fold counts if
`reference/surface_stretch.py` confirms it from the last file of fields.
"""

import argparse
import json
import resource
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from reference import surface_stretch
from repro.march.folding import CREASING
from repro.preflight import numbers
from repro.results import field_files, read_table
from repro.runs.status import COMPLETED
from repro.scene import load_scene
from verification.evidence.writing import REPORT

SEED, MEMBERS = 28, 100
RECORD = REPORT / "live" / "family.jsonl"
#: The end over the time to contact in growth at the supply, and the end (h) without contact.
PAST_CONTACT, LONGEST = 3.0, 200.0
#: Times of the rows over the end.
ROWS = (0.2, 0.4, 0.6, 0.8, 1.0)
DRIVES = ("head", "0.3 m/day", "10 m/day")


@dataclass(frozen=True)
class Member:
    """A pore of the family: width and seed (um), supply of both substrates (mg/L), and drive."""

    number: int
    width: float
    seed: float
    supply: float
    drive: str

    @property
    def sets(self) -> list[str]:
        """Changes of the scene "wide". The length is 24 W, and a head has the gradient of base."""
        length = 24 * self.width
        flow = [f'flow.mean_velocity="{self.drive}"']
        if self.drive == "head":
            flow = [f'flow.head="{length / 600 * 1e-3:.6g} cm"']
        return ["numerics.preset=fast", f'pore.width="{self.width:.4g} um"', f'pore.length="{length:.5g} um"',
                f'aggregate.radius="{self.seed:.4g} um"', *flow,
                *(f'substrates.{name}.supply="{self.supply:.4g} mg/L"' for name in ("acceptor", "donor"))]

    def words(self, end: float, *changes: str) -> list[str]:
        """Flags of the command line for a run to ``end`` (h)."""
        rows = ", ".join(f'"{part * end:.6g} h"' for part in ROWS)
        sets = [*self.sets, f'growth.end="{end:.6g} h"', f"output.times=[{rows}]", *changes]
        unset = ["--unset", "flow.mean_velocity"] if self.drive == "head" else []
        return [*unset, *(word for change in sets for word in ("--set", change))]

    @property
    def end(self) -> float:
        """End of the run, h."""
        unset = ["flow.mean_velocity"] if self.drive == "head" else []
        scene = load_scene("wide", [*self.sets, 'growth.end="1000 h"'], unset=unset)
        contact = numbers.at_end(scene).contact
        return LONGEST if contact is None else PAST_CONTACT * contact


def draw_member(number: int) -> Member:
    """The member with a number. It does not depend on the other members."""
    draw = np.random.default_rng([SEED, number])
    width = 25 * 8 ** draw.uniform()
    return Member(number, width, width * draw.uniform(0.1, 0.35), 0.28 * (100 / 0.28) ** draw.uniform(),
                  DRIVES[draw.integers(3)])


def run_member(member: Member, limit: int, *changes: str) -> dict:
    """Run a member, and judge its end."""
    end = member.end
    with TemporaryDirectory() as temporary:
        folder = Path(temporary) / "run"
        words = ["run", "wide", "--quiet", "--out", str(folder), *member.words(end, *changes)]
        child = subprocess.run([sys.executable, "-m", "repro", *words],
                               capture_output=True, text=True, check=False,
                               preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 5)))
        return {**vars(member), "end_h": end, "exit": child.returncode, **_outcome(folder, child)}


def _outcome(folder: Path, child: subprocess.CompletedProcess) -> dict:
    """Status, time (h), least stretch and verdict of the run in a folder."""
    try:
        record = json.loads((folder / "run.json").read_text(encoding="utf-8"))
        table = read_table(folder / "timeseries.csv")
    except (OSError, ValueError):
        return {"verdict": "too long" if child.returncode < 0 else "failed", "status": child.stderr.strip()}
    column = float(table["surface_stretch_min"][-1])
    outcome = {"status": record["status"], "time_h": float(table["time_h"][-1]), "stretch": column,
               "contact": bool(table["contact"][-1]), "seconds": record["wall_time_s"],
               "times_h": table["time_h"].tolist(), "stretches": table["surface_stretch_min"].tolist()}
    if child.returncode:
        return {"verdict": "too long" if child.returncode < 0 else "failed", **outcome}
    if "folds" not in record["status"]:
        return {"verdict": "end" if record["status"] == COMPLETED else "pore's end", **outcome}
    confirmed = confirmed_stretch(folder)
    verdict = "fold" if confirmed < CREASING else "fold, not confirmed"
    return {"verdict": verdict, "confirmed": confirmed, **outcome}


def confirmed_stretch(folder: Path) -> float:
    """The least stretch from the last file of fields."""
    grid = field_files.read(sorted((folder / "fields").glob("fields_*.vtu"))[-1])
    before = np.nan_to_num(grid.point_data["position_t0_um"][:, :2])
    stretch, distance, _ = surface_stretch.surface_stretch(
        grid.points[:, :2], grid.cells, grid.cell_data["region"] == 1, before)
    return float(surface_stretch.least(stretch, distance))


def main() -> int:
    """Run members one after the other, and add a line for each to the record. Return 1 if one has failed."""
    parser = argparse.ArgumentParser(description=__doc__)
    for name, default in (("first", 0), ("count", MEMBERS), ("limit", 120)):
        parser.add_argument(f"--{name}", type=int, default=default)
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    parser.add_argument("--record", type=Path, default=RECORD)
    options = parser.parse_args()
    options.record.parent.mkdir(parents=True, exist_ok=True)
    bad = 0
    for number in range(options.first, options.first + options.count):
        row = run_member(draw_member(number), options.limit, *options.set)
        bad += row["verdict"] not in ("end", "pore's end", "fold")
        print(json.dumps(row), flush=True)
        with options.record.open("a", encoding="utf-8") as file:
            file.write(json.dumps(row) + "\n")
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main())
