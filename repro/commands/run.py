"""``repro run SCENE --out DIR [--set KEY=VALUE ...]``: run a scene into a folder."""

from __future__ import annotations

import sys
from pathlib import Path

from tqdm import tqdm

from repro.running import run
from repro.scene import load_scene, packaged_scenes


def add(commands) -> None:
    """The parser of this command."""
    command = commands.add_parser("run", help="run a scene", description="Run a scene and write its results.")
    add_scene(command)
    command.add_argument("--out", metavar="DIR", type=Path, required=True, help="folder for the results")
    command.set_defaults(call=call)


def add_scene(command) -> None:
    """The arguments that name a scene."""
    command.add_argument("scene", metavar="SCENE",
                         help=f"a TOML file, or a packaged scene: {', '.join(packaged_scenes())}")
    command.add_argument("--set", metavar="KEY=VALUE", action="append", default=[],
                         help='change a key of the scene, such as growth.end="5 h"; may be repeated')


def call(chosen) -> int:
    """Run the scene that was chosen."""
    scene = load_scene(chosen.scene, chosen.set)
    status = _run(scene, chosen.out)
    print(f"{scene.name}: {status}; results in {chosen.out}")
    return 0


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
