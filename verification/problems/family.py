"""Practical pores drawn by seed. Far past contact each run reaches its end, the pore's end, or a confirmed fold.

    python -m verification.problems.family 17 18 --limit 60     # these members; all of them without numbers

Each member runs with the preset fast and a limit of processor time. A fold counts if `reference/surface_stretch.py`
confirms it from a file of fields.
"""

import argparse
import json
import math
import re
import sys
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time

import numpy as np

from reference import surface_stretch
from repro.errors import SimulationError
from repro.march.folding import CREASING
from repro.model.meshing import film
from repro.preflight import numbers
from repro.results import field_files, read_table
from repro.runs.execution import run
from repro.runs.status import COMPLETED
from repro.scene import Scene, load_scene
from verification.evidence.writing import REPORT, append, lines, table
from verification.problems.hard import TooLong, limited

SEED, MEMBERS = 28, 100
RECORD = REPORT / "pores.jsonl"
#: End of a run over the time to contact with growth at the supply, and the end (h) of a run without contact.
PAST_CONTACT, LONGEST = 3.0, 200.0
#: Latest time (h) of this contact, and the number of steps that find it.
LATEST, STEPS = 1000.0, 2000
#: Times of the rows over the end.
ROWS = (0.2, 0.4, 0.6, 0.8, 1.0)
DRIVES = ("head", "0.3 m/day", "10 m/day")
#: Relative difference of two computations of one stretch from the same shape: round-off of the fields in a file.
SAME = 1e-6
#: Edges closer to a contact line than this part of the surface's length do not count, as in the run.
BESIDE = 0.05
#: Time (h) of the least stretch in the message of a fold.
LEAST = re.compile(r"um at t = (\S+) h;")
#: Verdicts of runs that end as the model does.
ARRIVES, PORE_END = "end", "pore's end"
FOLD = "fold"
#: Words of the status of other ends, and their verdicts.
OTHER_ENDS = {**dict.fromkeys((" meet at ", " touches ", " touch in a second place at "), "meeting"),
              " detaches at ": "detachment"}
#: Verdicts that are errors.
UNCONFIRMED, FAILED = "fold, not confirmed", "failed"


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

    def scene(self, *changes: str) -> Scene:
        """The scene with changes; without an end among them it ends at 1000 h."""
        sets = [*self.sets, f'growth.end="{LATEST:g} h"', *changes]
        return load_scene("wide", sets, unset=["flow.mean_velocity"] if self.drive == "head" else [])

    @property
    def end(self) -> float:
        """End of the run, h."""
        contact = earliest_contact(self.scene())
        return LONGEST if contact is None else PAST_CONTACT * contact

    @property
    def duration(self) -> list[str]:
        """Changes that set the end and the times of rows."""
        rows = ", ".join(f'"{part * self.end:.6g} h"' for part in ROWS)
        return [f'growth.end="{self.end:.6g} h"', f"output.times=[{rows}]"]


def earliest_contact(scene: Scene) -> float | None:
    """Earliest time (h) of contact with the opposite wall, or None.

    A half-disc grows at the rate of the supply (9) in the layer that the supply reaches.
    """
    rate = max(0.0, numbers.fastest_growth(scene))
    layer = min(uptake.depth for uptake in numbers.uptakes(scene))
    radius, step = scene.aggregate.radius, LATEST / STEPS
    area = math.pi / 2 * radius**2
    for count in range(1, STEPS + 1):
        share = min(1.0, layer * math.pi * radius / area)
        area *= math.exp(rate * share * step)
        radius = math.sqrt(2 * area / math.pi)
        if radius >= scene.pore.width - film(scene):
            return count * step
    return None


def ends_before_contact(row: dict) -> bool:
    """Does a run reach its end without contact with the opposite wall? A longer run may fold."""
    return row["verdict"] == ARRIVES and not row["contact"]


def draw_member(number: int) -> Member:
    """The member with a number. It does not depend on the other members."""
    draw = np.random.default_rng([SEED, number])
    width = 25 * 8 ** draw.uniform()
    return Member(number, width, width * draw.uniform(0.1, 0.35), 0.28 * (100 / 0.28) ** draw.uniform(),
                  DRIVES[draw.integers(3)])


def run_member(member: Member, limit: float, *changes: str) -> dict:
    """Run a member, and judge its end. limit: s of processor time.

    The row has the processor time of the run with its files ("cpu_s").
    """
    return {**vars(member), **run_scene(partial(member.scene, *changes), member.duration, limit)}


def run_scene(scene_with: Callable[..., Scene], duration: list[str], limit: float) -> dict:
    """Run a scene to the end that ``duration`` sets, and judge how it ends; scene_with: takes changes of the scene."""
    scene = scene_with(*duration)
    start = process_time()
    with TemporaryDirectory() as temporary:
        folder = Path(temporary) / "run"
        try:
            with limited(limit):
                try:
                    status = run(scene, folder)
                finally:
                    cpu = process_time() - start
                judged = judge(folder, status)
                if judged["verdict"] == UNCONFIRMED:
                    judged = judge(_run_until_least(scene_with, folder, status), status)
        except (SimulationError, TooLong) as error:
            judged = {"verdict": FAILED, "status": str(error)}
        return {"end_h": scene.growth.end, "cpu_s": round(cpu, 2), **judged, **_course(folder)}


def _run_until_least(scene_with: Callable[..., Scene], folder: Path, status: str) -> Path:
    """Run a scene to the time of its least stretch, and return the folder. Later buckles raise the stretch."""
    creased = folder.with_name("creased")
    run(scene_with(f'growth.end="{LEAST.search(status)[1]} h"'), creased)
    return creased


def judge(folder: Path, status: str) -> dict:
    """Verdict and status, and for a fold the least independent stretches of all rows.

    Two conditions confirm a fold. In every row the independent stretch in the middle of an edge equals the run's. In at
    least one row the mean over an edge is below CREASING.
    """
    if "folds" not in status:
        other = next((end for words, end in OTHER_ENDS.items() if words in status), PORE_END)
        return {"verdict": ARRIVES if status == COMPLETED else other, "status": status}
    stretches = independent_stretches(folder)
    column = read_table(folder / "timeseries.csv")["surface_stretch_min"]
    mean, middle = stretches.min(axis=0).tolist()
    same = np.abs(stretches[:, 1] / column - 1) < SAME
    confirmed = mean < CREASING and same.all()
    return {"verdict": FOLD if confirmed else UNCONFIRMED, "status": status, "mean": mean, "middle": middle}


def _course(folder: Path) -> dict:
    """Times (h) and least stretches of the rows, and whether the last row has contact; empty without rows."""
    try:
        table = read_table(folder / "timeseries.csv")
    except (OSError, ValueError):
        return {}
    return {"contact": bool(table["contact"][-1]), "times_h": table["time_h"].tolist(),
            "stretches": table["surface_stretch_min"].tolist()}


def independent_stretches(folder: Path) -> np.ndarray:
    """(rows, 2) least stretches from the files of fields: the mean over an edge, and the value in its middle."""
    paths = sorted((folder / "fields").glob("*.vtu"))
    return np.array([_independent_stretch(field_files.read(path)) for path in paths])


def _independent_stretch(grid) -> np.ndarray:
    """The least stretches of all aggregates of a file; the region of a cell is the number of its aggregate."""
    before = np.nan_to_num(grid.point_data["position_t0_um"][:, :2])
    region = grid.cell_data["region"]
    least = []
    for number in np.unique(region[region > 0]):
        own = region == number
        stretch, distance, _ = surface_stretch.surface_stretch(grid.points[:, :2], grid.cells, own, before,
                                                               (region > 0) & ~own)
        least.append(surface_stretch.least(stretch, distance, BESIDE))
    return np.min(least, axis=0)


def read_record() -> dict[int, dict]:
    """Recorded rows by number. The last row of a member counts."""
    return dict(sorted({row["number"]: row for row in lines(RECORD)}.items()))


def page(rows: dict[int, dict]) -> str:
    """Markdown: how many members end in each way, and a table of all folds."""
    verdicts = Counter(row["verdict"] for row in rows.values())
    counts = ", ".join(f"{verdict}: {count}" for verdict, count in verdicts.most_common())
    folds = [row for row in rows.values() if row["verdict"] in (FOLD, UNCONFIRMED)]
    cells = [(row["number"], f"{row['width']:.0f}", f"{row['seed']:.0f}", f"{row['supply']:.2g}", row["drive"],
              f"{row['times_h'][-1]:.3g}", "yes" if row["contact"] else "no", f"{row['middle']:.3f}",
              f"{row['mean']:.3f}", "yes" if row["verdict"] == FOLD else "no")
             for row in sorted(folds, key=lambda row: row["width"])]
    head = ("member", "width (um)", "seed (um)", "supply (mg/L)", "drive", "fold (h)", "contact before it",
            "least stretch of the rows, middle of an edge", "mean over an edge", "confirmed")
    return (f"# Pores of the family\n\nWritten by `python -m verification.problems.family`. {len(rows)} "
            f"pores: {counts}.\n\n{_times(rows)}\n\n{table(head, cells)}\n")


def _times(rows: dict[int, dict]) -> str:
    """A sentence on the processor times of the runs."""
    times = {number: row["cpu_s"] for number, row in rows.items()}
    longest = sorted(times, key=times.__getitem__)[-3:][::-1]
    return (f"The processor time of a run with its files has a median of {np.median([*times.values()]):.1f} s. The "
            "longest runs are " + ", ".join(f"member {number} ({times[number]:.1f} s)" for number in longest) + ".")


def main(numbers: list[int], limit: float) -> int:
    """Run members, and add a line for each to the record. Return 1 if a member fails."""
    failures = 0
    for number in numbers:
        row = run_member(draw_member(number), limit)
        failures += row["verdict"] in (UNCONFIRMED, FAILED)
        print(json.dumps(row), flush=True)
        append(row, RECORD)
    RECORD.with_suffix(".md").write_text(page(read_record()), encoding="utf-8")
    return int(failures > 0)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("numbers", type=int, nargs="*", default=range(MEMBERS))
    parser.add_argument("--limit", type=float, default=120.0)
    options = parser.parse_args()
    sys.exit(main(options.numbers, options.limit))
