"""``repro run SCENE --out DIR``: run a scene into a folder.

``repro run --resume DIR`` resumes the run in a folder.
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from repro.cli.arguments import add_scene, path, seconds
from repro.errors import SimulationError
from repro.runs import INTERVAL, interrupts, progress
from repro.scene import Scene, load_scene
from repro.scene.files import key_of

if TYPE_CHECKING:
    from repro.runs.execution import Watch

DESCRIPTION = """\
Run a scene and write its results, or resume a run that was interrupted or killed. A resumed run has
the same results as an uninterrupted one, to the last bit. If DIR already contains a run of the same
scene, that run is resumed; a finished run is left unchanged. --resume DIR --set growth.end="30 h"
makes a run longer: it then equals a run that had this end from its start."""
STATUS = """exit status:
  0    the run has reached the end of the scene or of the model
  1    a stage failed; the message names the simulated time, the stage, the reason, the file of the
       last good state, and a change to try
  2    the input is wrong, or the folder cannot be used: it contains another run or other files, it
       is not writable, another process uses it, or the disk is full
  130  interrupted (SIGINT, Ctrl-C), or 143, terminated (SIGTERM), or 129, 138 or 140, noticed
       (SIGHUP, SIGUSR1, SIGUSR2): the present step is discarded, the results so far and a
       checkpoint are written, and --resume continues the run; a second signal, after a second or
       more, ends the process at once"""


def add(commands) -> None:
    """Add the parser of this command."""
    command = commands.add_parser(
        "run", help="run a scene, or resume a run", description=DESCRIPTION, epilog=STATUS,
        formatter_class=argparse.RawDescriptionHelpFormatter)
    add_scene(command, nargs="?")
    command.add_argument("--out", metavar="DIR", type=path, help="folder for the results")
    command.add_argument("--resume", metavar="DIR", type=path,
                         help="resume the run in this folder")
    command.add_argument("--force", action="store_true",
                         help="remove the files that the run.json in DIR lists, and start again")
    command.add_argument("--checkpoint", metavar="SECONDS", type=seconds, default=INTERVAL,
                         help="wall time after which a checkpoint and the results so far are "
                         "written again (default: %(default)g)")
    command.add_argument("--quiet", action="store_true", help="print only warnings and errors")
    command.add_argument("--json", action="store_true",
                         help="print each event as one line of JSON")
    command.set_defaults(call=call, refuse=command.error)


def call(options) -> int:
    """Run the scene, or resume the run."""
    conflicting = [options.scene, options.unset, options.out, options.force]
    conflicting += [entry for entry in options.set if key_of(entry) != "growth.end"]
    if options.resume and any(conflicting):
        options.refuse("--resume reads the scene from the run's folder: SCENE, --unset, --out and "
                       "--force are not accepted with it, and --set can change growth.end only")
    if not options.resume and not (options.scene and options.out):
        options.refuse("give SCENE and --out DIR, or --resume DIR")
    with interrupts.catch_signals() as stop:  # before NumPy starts threads that it would miss
        scene = None if options.resume else load_scene(options.scene, options.set,
                                                       unset=options.unset)
        from repro.runs.execution import Watch

        with progress.display_events(options.quiet, options.json) as tell:
            try:
                _run(options, scene, Watch(tell, options.checkpoint, stop, stop))
            except MemoryError as error:  # not within a step, which reports its own
                raise SimulationError(f"out of memory ({error}); try a smaller "
                                      "numerics.refinement") from error
    return 0


def _run(options, scene: Scene | None, watch: Watch) -> None:
    """Run the scene, or resume the run if there is no scene."""
    from repro.runs.execution import origin_of, resume, run

    if scene is None:
        resume(options.resume, options.set, watch=watch)
    else:
        origin = origin_of(options.scene, options.set, options.unset)
        run(scene, options.out, watch=watch, force=options.force, origin=origin)
