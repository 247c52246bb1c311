"""The runs behind the figures: their scenes and options, and their folders."""

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
    """A run of a packaged scene.

    Parameters
    ----------
    scene : str
        Name of the packaged scene.
    overrides : tuple of str
        Changes of the scene, as for `--set`.
    label : str
        Name of the run if a scene has several; the default is the scene's name.

    Examples
    --------
    >>> from paper_figures.runs import Request
    >>> Request("base", ('growth.end="1 h"',), "base_short").name
    'base_short'
    """

    scene: str
    overrides: tuple[str, ...] = ()
    label: str = ""

    @property
    def name(self) -> str:
        """The name of the run."""
        return self.label or self.scene

    def load(self) -> Scene:
        """Read and check the scene."""
        return load_scene(self.scene, self.overrides)

    def command(self) -> str:
        """Return the command that computes the same run."""
        changes = [part for change in self.overrides for part in ("--set", change)]
        return shlex.join(["repro", "run", self.scene, "--out", f"runs/{self.name}", *changes])


#: Section 4. With output times, a run also writes its fields before the expansion at each time (Plate 1).
BASE = Request("base", (rows_at(*range(1, 20), 19.2, 19.4),))
#: Figure 6, with every shape update.
WIDE = Request("wide")
#: Wide in the converged solution of the claims. Its outlines are curves. In the paper's scheme whole edges come into
#: contact, and a spline through their nodes is not smooth.
WIDE_CONVERGED = Request("wide", (*converged(1.0), rows_at(*range(1, 35), *(34 + 0.1 * k for k in range(1, 10)),
                                                           *range(35, 46))), "wide_converged")
#: Figure 6 with other supplies (the paper prints none): supply of both substrates in K_s, the last hour, and the length
#: of the pore in um. With 40 K_s the aggregate reaches the end of Wide's 600 um at 33.3 h.
SUPPLIED = {supply: Request("wide", ('numerics.preset="fast"', *until(*range(1, end + 1)),
                                     *(f'substrates.{name}.supply="{supply} mg/L"' for name in ("acceptor", "donor")),
                                     *lengthened), f"wide_{supply}_K_s")
            for supply, end, lengthened in ((5, 55, ()), (40, 45, ('pore.length="2400 um"',)))}
#: Figure 4: only geometry and mesh.
INITIAL_MESH = Request("initial_mesh")

#: Runs for the discussion, in the preset "fast": Base continued beyond contact; Wide; Wide with one change of its
#: rheology, or with a permeable body.
FAST = 'numerics.preset="fast"'
#: In the steps of "fast", up to 10 h, the growth rate of Base, a difference of interpolated rows, has a false peak
#: before contact.
CLOSING = Request("base", (FAST, "numerics.tolerance=0.002", *until(*range(1, 73), *np.arange(72.5, 76.25, 0.25))),
                  "base_closing")
_UNTIL = (FAST, *until(*range(1, 33), *np.arange(32.5, 37, 0.25), *range(37, rheology.END + 1)))
WIDE_FAST = Request("wide", _UNTIL, "wide_fast")
#: No key of a scene chooses fixed points anew, so C41 alone has this variant.
VARIANTS = {name: Request("wide", (*_UNTIL, change), "wide_" + re.sub(r"\W", "_", name))
            for name, change in rheology.VARIANTS.items() if change != rheology.RECHOSEN}
PERMEABILITIES = (1e-12 * rheology.PERMEABILITY, 1e-12 * 100.0**2 / 12 / 2000)
PERMEABLE = tuple(Request("wide", (*_UNTIL, f'flow.permeability="{value:.3g} m^2"'),
                          f"wide_permeable_{value:.0e}") for value in PERMEABILITIES)


def folders(requests: Iterable[Request]) -> list[Path]:
    """Folders of several runs; missing runs are computed in parallel."""
    return STORE.get_all(request.load() for request in requests)
