"""Command line: ``repro run SCENE --out DIR [--set KEY=VALUE ...]``.

Exit status: 0 when the run has ended, 1 when a stage failed, 2 when something in the input is wrong, 130 when
interrupted.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from tqdm import tqdm

from repro.errors import SimulationError
from repro.running import OutputError, run
from repro.scene import SceneError, load_scene, packaged_scenes


def main(arguments: list[str] | None = None) -> int:
    """Entry point; returns the exit status."""
    chosen = _parser().parse_args(arguments)
    try:
        scene = load_scene(chosen.scene, chosen.set)
        status = _run(scene, chosen.out)
    except (SceneError, OutputError) as error:
        return _fail(error, 2)
    except SimulationError as error:
        return _fail(error, 1)
    except KeyboardInterrupt:
        return _fail("interrupted; what was computed is written", 130)
    print(f"{scene.name}: {status}; results in {chosen.out}")
    return 0


def _fail(message, status: int) -> int:
    print(f"repro: {message}", file=sys.stderr)
    return status


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="repro", description="Biological clogging of one pore by the growth of an "
                                     "aggregate (Dupin, Kitanidis & McCarty 2001).")
    commands = parser.add_subparsers(dest="command", required=True)
    command = commands.add_parser("run", help="run a scene", description="Run a scene and write its results.")
    command.add_argument("scene", metavar="SCENE",
                         help=f"a TOML file, or a packaged scene: {', '.join(packaged_scenes())}")
    command.add_argument("--out", metavar="DIR", type=Path, required=True, help="folder for the results")
    command.add_argument("--set", metavar="KEY=VALUE", action="append", default=[],
                         help='change a key of the scene, such as growth.end="5 h"; may be repeated')
    return parser


def _run(scene, folder: Path) -> str:
    """Run with a progress bar on a terminal, quiet lines elsewhere."""
    end = scene.growth.end if scene.growth else 0.0
    if not sys.stderr.isatty():
        return run(scene, folder, _quiet_lines(end))
    form = "{l_bar}{bar}| {n:.1f} of {total:.1f} h [{elapsed} < {remaining}]"
    with tqdm(total=end or 1.0, desc=scene.name, bar_format=form) as bar:
        return run(scene, folder, lambda time: bar.update(time - bar.n))


def _quiet_lines(end: float):
    """A line at each tenth of the simulated time."""
    told = 0

    def tell(time: float) -> None:
        nonlocal told
        tenth = int(10 * time / end + 1e-9) if end else 0
        if tenth > told:
            told = tenth
            print(f"{time:g} of {end:g} h simulated", file=sys.stderr, flush=True)
    return tell


if __name__ == "__main__":
    sys.exit(main())
