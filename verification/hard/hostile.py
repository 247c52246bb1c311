"""A family of hostile scenes, drawn by seed: each is right, or is refused with advice that works.

A member is run with ``fast``, with other rows and with ``accurate``; ``reference.run_files`` judges the folders. Where
it is refused, its advice is followed until a run completes. ``python -m verification.hard.hostile SEED`` runs one
member and shows its scene.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from reference import run_files
from repro.errors import SimulationError
from repro.run.running import run
from repro.scene import SceneError, load_scene
from verification.hard.common import TooLong, limited
from verification.kernel.case import Check, at_most
from verification.problems import hostile

#: Processor time (s) of one run.
LIMIT = 60.0
NO_SETTING = re.compile(r"no (setting|value|numerics\.refinement)\b.*(helps|resolve)")
