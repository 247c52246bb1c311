"""The runs that the figures are drawn from: what is asked for, in one place, and where the results are."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from repro import Scene, load_scene
from verification.claims import rheology
from verification.claims.levels import converged
from verification.claims.runs import rows_at, until
from verification.store import Folders

STORE = Folders(Path(__file__).parent / "cache")


@dataclass(frozen=True)
class Request:
    """A packaged scene with what `--set` changes in it; `label`: what it is called where one scene is run in several
    ways, the scene's name by default."""

    scene: str
    overrides: tuple[str, ...] = ()
    label: str = ""

    @property
    def name(self) -> str:
        """Which run it is."""
        return self.label or self.scene

    def load(self) -> Scene:
        """The scene, read and checked."""
        return load_scene(self.scene, self.overrides)

    def command(self) -> str:
        """What to type for the same run."""
        changes = [part for change in self.overrides for part in ("--set", change)]
        return shlex.join(["repro", "run", self.scene, "--out", f"runs/{self.name}", *changes])


#: Section 4; with times given, a run also writes its fields as they are before each of them's expansion (Plate 1).
BASE = Request("base", (rows_at(*range(1, 20), 19.2, 19.4),))
#: Figure 6, every shape update.
WIDE = Request("wide")
#: The same in the converged solution of the claims: its outlines are curves, while those of the paper's scheme come to
#: contact with whole edges, on nodes that a spline does not run through smoothly.
WIDE_CONVERGED = Request("wide", (*converged(1.0), rows_at(*range(1, 35), *(34 + 0.1 * k for k in range(1, 10)),
                                                           *range(35, 46))), "wide_converged")
#: Figure 4, geometry and mesh only.
INITIAL_MESH = Request("initial_mesh")

#: What the discussion speaks of, in the preset "fast". Base carried on through contact; wide, and wide with one choice
#: of the rheology changed, or with a permeable body.
FAST = 'numerics.preset="fast"'
CLOSING = Request("base", (FAST, *until(*range(1, 73), *np.arange(72.5, 76.25, 0.25))), "base_closing")
_UNTIL = (FAST, *until(*range(1, 33), *np.arange(32.5, 37, 0.25), *range(37, rheology.END + 1)))
WIDE_FAST = Request("wide", _UNTIL, "wide_fast")
VARIANTS = {name: Request("wide", (*_UNTIL, change), "wide_" + re.sub(r"\W", "_", name))
            for name, change in rheology.VARIANTS.items()}
PERMEABILITIES = (1e-12 * rheology.PERMEABILITY, 1e-12 * 100.0**2 / 12 / 2000)
PERMEABLE = tuple(Request("wide", (*_UNTIL, 'flow.biomass="brinkman"', f'flow.permeability="{value:.3g} m^2"'),
                          f"wide_permeable_{value:.0e}") for value in PERMEABILITIES)


def folders(requests: Iterable[Request]) -> list[Path]:
    """Results folders of several requests, the missing ones computed side by side."""
    return STORE.get_all(request.load() for request in requests)
