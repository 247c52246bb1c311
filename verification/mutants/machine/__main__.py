"""Run the session: ``python -m verification.mutants.machine``."""

import argparse
import contextlib
import importlib.util
import os
import sys

from repro.runs.machine import source_hash
from verification.evidence.writing import REPORT
from verification.mutants import runner
from verification.mutants.machine import reach, record, sample


def main() -> int:
    """Run the session, and return 0 if enough mutants are caught."""
    about = "Run a sample of machine-made mutants of repro/ against the tests that reach them."
    parser = argparse.ArgumentParser(prog="python -m verification.mutants.machine", description=about)
    parser.parse_args()
    if not importlib.util.find_spec("cosmic_ray"):
        parser.error("cosmic-ray is needed, which `make mutants-sampled` installs from "
                     "verification/mutants/machine/requirements.lock")
    folder = REPORT / "live" / f"machine-{source_hash()}"
    folder.mkdir(parents=True, exist_ok=True)
    with runner.copied() as project, contextlib.chdir(project):
        execute(folder)
    return record.write(record.rows_of(folder / "session.sqlite"))


def execute(folder) -> None:
    """Start or continue the session of the present source, in a copy of the project."""
    from cosmic_ray.commands import execute as execute_session
    from cosmic_ray.config import ConfigDict
    from cosmic_ray.work_db import use_db

    os.environ["PYTHONPATH"] = os.getcwd()
    if not (folder / reach.TESTS).exists():
        reach.measure(folder)
    with use_db(str(folder / "session.sqlite")) as session:
        if not session.num_work_items:
            session.add_work_items(sample.draw())
        command = f"{sys.executable} -m verification.mutants.machine.reach {runner.ROOT} {folder}"
        config = ConfigDict({"test-command": command, "timeout": 10 * reach.LIMIT, "distributor": {"name": "local"}})
        execute_session(session, config)


if __name__ == "__main__":
    sys.exit(main())
