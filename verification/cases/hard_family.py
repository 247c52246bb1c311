"""A family of hostile scenes, drawn by seed. Each is right, or is refused with advice that works.

A member runs with the preset ``fast``, and a second time with other rows or with ``accurate``. ``reference.run_files``
judges the folders. A member with several aggregates is also killed and resumed, and must have the same files. If a run
is refused, its advice is applied, and the new run must be right.
``pytest "verification/cases/hard_family.py::test_family[seed 17]"`` runs one member, and shows its scene if a check
fails.
"""

import json
import os
import re
import signal
from collections.abc import Iterator
from copy import deepcopy
from dataclasses import dataclass
from itertools import count
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

from reference import run_files
from repro.errors import SimulationError
from repro.polling import polling
from repro.runs.execution import Watch, run
from repro.scene import SceneError, load_scene
from verification.evidence.checks import Check, at_most
from verification.problems import hostile
from verification.problems.hard import TooLong, limited

#: Limit of the processor time (s) of a run, for each of its aggregates: a hundred times the median.
LIMIT = 30.0
#: Members, of which the last 30 have several aggregates.
MEMBERS = 220
#: Cheap members, in ``make test``. ``make verify`` runs the others too.
QUICK = (0, 2, 3, 6, 8, 9, *range(164, 171), 191, 204)
REST = tuple(seed for seed in range(MEMBERS) if seed not in QUICK)
#: Number of times that a member with several aggregates is killed, and files without results in its folder.
KILLS = 3
RECORDS = ("run.json", "report.html", "checkpoint.last")
#: Checks that are not judged. By zero order the growth of 172 jumps at a front in the aggregate, on which ``fast``
#: puts a few elements: its thickness is wrong by 0.2 %, and the head loss of the film above it, a sixth of the width,
#: by 1.6 %.
NOT_JUDGED = {172: {"head_loss_cm in fast less that in accurate, relative",
               "conductivity_m_per_d in fast less that in accurate, relative"}}
NO_HELP = re.compile("no setting helps")
FILE = re.compile(r"\S+/\S+\.(?:state|vtu)|fields/\S+\.vtu")
#: Advice in messages: pattern, key, and values to try, from the present value or the number in the message.
ADVICE = (
    (r'numerics\.preset = "paper"', "numerics.preset", lambda present, number: ["paper"]),
    (r"larger numerics\.refinement", "numerics.refinement", lambda present, number: [1.5 * present, 2.5 * present]),
    (r"smaller numerics\.refinement", "numerics.refinement", lambda present, number: [present / 2]),
    (r'numerics\.transport = "quasi_steady"', "numerics.transport", lambda present, number: ["quasi_steady"]),
    (r"larger growth\.shear_modulus", "growth.shear_modulus",
     lambda present, number: [f"{10 * present!r} MPa", f"{100 * present!r} MPa"]),
    (r"shorter growth\.time_step", "growth.time_step",
     lambda present, number: [f"{present / 4!r} h", f"{present / 20!r} h"]),
    (r"flow\.permeability[^;]*? ([\d.e+-]+ (?:m|um)\^2) or more", "flow.permeability",
     lambda present, number: [number]),
    (r"aggregate\.smooth = false|smooth = false", "aggregate.smooth", lambda present, number: [False]),
)


@dataclass(frozen=True)
class Outcome:
    """Files of a run, or None; the message of its refusal, or ""; and how often Newton's methods polled."""

    files: run_files.Run | None
    refusal: str
    polls: int


def judge(seed: int) -> list[Check]:
    """All checks of one member."""
    tables = hostile.scene(seed)
    with TemporaryDirectory() as room:
        return list(_judged(tables, seed, Path(room)))


def _judged(tables: dict, seed: int, room: Path) -> Iterator[Check]:
    first = _outcome(tables, room / "fast")
    yield from _checks(first, tables, room)
    if first.refusal:
        return
    if seed >= hostile.FIRST_BODIES:
        yield _killed(tables, seed, room, first.polls)
    rows = (seed + seed // len(hostile.KINDS)) % 2 == 0 or hostile.kind(seed) in hostile.TRANSIENT
    second = hostile.with_other_rows(tables, seed) if rows else _changed(tables, "numerics.preset", "accurate")
    other = _outcome(second, room / "second")
    yield from _checks(other, second, room)
    if not other.refusal:
        compare = run_files.same_rows if rows else run_files.close
        yield from (Check(*finding) for finding in compare(first.files, other.files))


def _outcome(tables: dict, folder: Path) -> Outcome:
    """Run a scene. One that takes too long counts as refused. Any other exception propagates."""
    refusal = ""
    polls = count()
    try:
        scene = load_scene(tables)
        with limited(LIMIT * len(scene.aggregates)), polling(lambda: next(polls)):
            run(scene, folder)
    except (SceneError, SimulationError, TooLong) as failure:
        refusal = str(failure)
    files = run_files.Run(folder, tables) if (folder / "timeseries.csv").is_file() else None
    return Outcome(files, refusal, next(polls))


def _killed(tables: dict, seed: int, room: Path, polls: int) -> Check:
    """Check that a run has the files of that in room / "fast" if it is killed within steps and resumed.

    polls: of the run in room / "fast". Each kill comes before half of them, so the first one is within the run.
    """
    folder = room / "killed"
    for last in np.random.default_rng((seed, 2)).integers(1, 1 + polls // 2, KILLS):
        child = get_context("fork").Process(target=_run_until, args=(tables, folder, int(last)))
        child.start()
        child.join()
    run(load_scene(tables), folder)
    expected, computed = _files(room / "fast"), _files(folder)
    different = [name for name in {*expected, *computed} if expected.get(name) != computed.get(name)]
    resumes = len(json.loads((folder / "run.json").read_text())["resumes"])
    return at_most("files that kills and resumes change", len(different) + (resumes == 0), 0, "bit for bit")


def _run_until(tables: dict, folder: Path, last: int) -> None:
    """Run or resume a scene with a checkpoint after each step, and kill the process at the poll with a number."""
    polls = count(1)

    def kill() -> int:
        if next(polls) == last:
            os.kill(os.getpid(), signal.SIGKILL)
        return 0

    run(load_scene(tables), folder, Watch(interval=0.0, stop_within=kill))


def _files(folder: Path) -> dict[str, bytes]:
    """{name: content} of the files with results in a folder."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*")
            if path.is_file() and path.name not in RECORDS}


def _checks(outcome: Outcome, tables: dict, room: Path) -> Iterator[Check]:
    """Checks of the files of a run, and of the advice of a refusal."""
    if outcome.files:
        yield from (Check(*finding) for finding in run_files.findings(outcome.files))
    if outcome.refusal:
        yield from _refusal(outcome.refusal, room)
        works = bool(NO_HELP.search(outcome.refusal)) or any(
            _is_right(scene, room / "advised") for scene in _advised_scenes(tables, outcome.refusal))
        yield at_most(f"refusals without advice that works: {outcome.refusal}", not works, 0, "a refusal helps")


def _refusal(message: str, room: Path) -> Iterator[Check]:
    yield at_most("lines of a refusal beyond one", message.count("\n"), 0, "one line")
    named = [Path(name) for name in FILE.findall(message)]
    folders = [Path("/"), *room.iterdir()]
    missing = [path for path in named if not any((folder / path).exists() for folder in folders)]
    yield at_most("files that a refusal names and that do not exist", len(missing), 0, "a user looks there")


def _advised_scenes(tables: dict, message: str) -> Iterator[dict]:
    """The scene with each piece of advice in turn."""
    for pattern, key, values in ADVICE:
        match = re.search(pattern, message)
        if match:
            number = match.group(1) if match.groups() else ""
            yield from (_changed(tables, key, value) for value in values(_present(tables, key), number))


def _present(tables: dict, key: str) -> object:
    """The value of a key in the scene, in the package's units."""
    section, name = key.split(".")
    return getattr(getattr(load_scene(tables), section), name)


def _changed(tables: dict, key: str, value) -> dict:
    section, name = key.split(".")
    changed = deepcopy(tables)
    changed.setdefault(section, {})[name] = value
    return changed


def _is_right(tables: dict, folder: Path) -> bool:
    """Whether a run completes with files that are right."""
    outcome = _outcome(tables, folder / str(len(list(folder.glob("*")))))
    return not outcome.refusal and all(finding.holds for finding in run_files.findings(outcome.files))


def member(seed: int) -> Check:
    """Check that the checks of a member hold, except for those that are not judged. The name lists those that fail."""
    not_judged = NOT_JUDGED.get(seed, set())
    failed = [f"{check.quantity} {check.value:.3g}" for check in judge(seed)
              if not check.holds and check.quantity not in not_judged]
    message = f": {'; '.join(failed)[:600]}" if failed else ""
    return at_most(f"{hostile.kind(seed)}{message}", len(failed), 0, "reference/run_files.py; a refusal's advice works")


#: Fields of the mark that both cases of the family share.
COMMON = {
    "kind": "property",
    "claim": "Hostile scenes drawn by seed: balances, bounds, stoichiometry, area against mass and flow in the files, "
             "the same rows with other rows, fast against accurate, the same files of several aggregates after kills, "
             "or a refusal with advice that works",
    "norm": "checks that fail, of each member; the head loss of 172 is not judged",
    "mutants": ("family-jump-late", "family-half-saturation", "family-rest-of-the-pore-forgotten",
                "family-rows-end-steps", "family-effluent-not-weighted", "family-inhibition", "family-decay-limited",
                "family-absent-donor-limits"),
    "references": ("run_files",), "runs_with": "2 fast accurate",
    "omitted": "members have quadratic triangles, straight ones run where advice names them; hard-01 to hard-23 run "
               "order 1, paper and exact"}
MARKS = {QUICK: (pytest.mark.case("hard-family", **COMMON),),
         REST: (pytest.mark.case("hard-family-rest", **COMMON), pytest.mark.slow)}


@pytest.mark.parametrize("seed", [pytest.param(seed, id=f"seed {seed}", marks=marks)
                                  for seeds, marks in MARKS.items() for seed in seeds])
def test_family(seed, record):
    """Judge a member. A failure shows its scene."""
    print(json.dumps(hostile.scene(seed)))
    record(member(seed))
