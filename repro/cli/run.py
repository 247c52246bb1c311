"""``repro run SCENE --out DIR``: run a scene into a folder.

``repro run --resume DIR`` goes on with the run in a folder.
"""

from __future__ import annotations

import argparse
import math
import os
from typing import TYPE_CHECKING

from repro.cli.arguments import add_scene, path
from repro.errors import SimulationError
from repro.runs import INTERVAL, interrupts, progress
from repro.scene import Scene, load_scene, packaged_scenes
from repro.scene.files import key_of

if TYPE_CHECKING:
    from repro.runs.running import Watch

DESCRIPTION = """\
Run a scene and write its results, or go on with a run that was interrupted or killed: the result is
the same to the last bit. Where DIR holds a run of the same scene, that is gone on with, or left
alone where it is over. --resume DIR --set growth.end="30 h" makes a run longer, over or not, as if
that had been asked for at first."""
STATUS = """exit status:
  0    done: the scene's end, or the pore's, is reached, now or before
  1    a stage failed; the message says at what simulated time, in which stage, why, where the
       last good state is, and what to change
  2    wrong input, or the folder cannot be used: another run's or not a run's, not writable, disk
       full, in use
  130  interrupted (SIGINT, Ctrl-C); 143 terminated (SIGTERM): the step in hand is finished, results
       and checkpoint are written, and --resume goes on from there; a second signal, after a second
       or more, stops at once"""


def add(commands) -> None:
    """The parser of this command."""
    command = commands.add_parser(
        "run", help="run a scene, or go on with a run", description=DESCRIPTION, epilog=STATUS,
        formatter_class=argparse.RawDescriptionHelpFormatter)
    add_scene(command, nargs="?")
    command.add_argument("--out", metavar="DIR", type=path, help="folder for the results")
    command.add_argument("--resume", metavar="DIR", type=path,
                         help="go on with the run in this folder")
    command.add_argument("--force", action="store_true",
                         help="remove the files of the run in DIR, as its run.json lists them, and "
                         "begin anew")
    command.add_argument("--checkpoint", metavar="SECONDS", type=_seconds, default=INTERVAL,
                         help="write what a run can go on from, and results so far, so often "
                         "(default: %(default)g)")
    command.add_argument("--quiet", action="store_true", help="say nothing but warnings and errors")
    command.add_argument("--json", action="store_true",
                         help="say what happens as one JSON object a line")
    command.set_defaults(call=call, refuse=command.error)


def _seconds(text: str) -> float:
    value = float(text)
    if not 0 <= value < math.inf:
        raise argparse.ArgumentTypeError(f"{text}: a number of seconds, zero or more, is needed")
    return value


def call(chosen) -> int:
    """Run the scene that was chosen, or go on with the run."""
    others = [chosen.scene, chosen.unset, chosen.out, chosen.force]
    others += [entry for entry in chosen.set if key_of(entry) != "growth.end"]
    if chosen.resume and any(others):
        chosen.refuse("--resume takes the scene from the run's folder: no SCENE, --unset, --out or "
                      "--force is accepted with it, and no --set but of growth.end")
    if not chosen.resume and not (chosen.scene and chosen.out):
        chosen.refuse("SCENE and --out DIR are needed, or --resume DIR")
    scene = None if chosen.resume else load_scene(chosen.scene, chosen.set, chosen.unset)
    from repro.runs.running import Watch

    with interrupts.noted() as stop, progress.told(chosen.quiet, chosen.json) as tell:
        try:
            _run(chosen, scene, Watch(tell, chosen.checkpoint, stop))
        except MemoryError as error:  # outside of the steps, whose failures tell more
            raise SimulationError(f"out of memory ({error}); try a smaller "
                                  "numerics.refinement") from error
    return 0


def _run(chosen, scene: Scene | None, watch: Watch) -> None:
    """Run the scene, or go on with the run where there is none."""
    from repro.runs.running import resume, run

    if scene is None:
        resume(chosen.resume, watch=watch, overrides=chosen.set)
    else:
        run(scene, chosen.out, watch=watch, force=chosen.force, origin=_origin(chosen))


def _origin(chosen) -> dict:
    """Where the scene comes from, for ``run.json``: a packaged name or a path, and its changes."""
    packaged = chosen.scene in packaged_scenes()
    file = chosen.scene if packaged else os.path.abspath(chosen.scene)
    return {"file": file, "set": chosen.set, "unset": chosen.unset}
