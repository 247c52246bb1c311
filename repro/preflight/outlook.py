"""Run a scene coarsely, with the preset ``sketch``, for a few seconds."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any

from repro.errors import RunEnd, SimulationError, StageError
from repro.march.simulation import steps
from repro.model.pore import Pore
from repro.model.transport_in_time import transport_in_time
from repro.polling import OutOfTime, within
from repro.preflight.memory import first_nodes
from repro.preflight.simplifications import Caveat, warn_surface
from repro.scene import PRESETS, Scene
from repro.schemes import CURVED

#: Wall time (s) of a coarse run.
LIMIT = 5.0
#: Steps on a mesh with more nodes take a good part of this time.
MOST_NODES = 5000


@dataclass(frozen=True)
class Outlook:
    """Result of a coarse run.

    time: simulated time (h) that it reached; stopped: why it went no farther, empty at growth.end;
    contact: time (h) at which the aggregate first touches the opposite wall, None without contact;
    seconds: its wall time.
    """

    time: float
    stopped: str
    contact: float | None
    seconds: float


class CoarseRun:
    """A coarse run of a scene, step by step.

    pore: after the last step, None before the first state; steps: length (h) and wall time (s) of
    each; node_growth: nodes of the largest mesh over those of the first one; ends: does the model
    end before growth.end?
    """

    def __init__(self, scene: Scene):
        self.scene = sketched(scene)
        self.pore: Pore | None = None
        self.steps: list[tuple[float, float]] = []
        self.node_growth = 1.0
        self.ends = False
        self.contact: float | None = None
        self.warnings: dict[str, Caveat] = {}

    def run(self, report: Callable[[float], None], limit: float) -> Outlook:
        """Make steps for ``limit`` s or to an end; report: receives the time (h) after each."""
        start = perf_counter()
        stopped = ""
        try:
            if first_nodes(self.scene) > MOST_NODES:
                stopped = "the meshes of the preset sketch are too large"
            else:
                with within(limit, perf_counter):
                    self._run(report)
        except RunEnd as end:
            self.ends = True
            stopped = f"the run ends there: {end}"
        except OutOfTime:
            stopped = f"its {limit:g} s are over"
        except (SimulationError, StageError, ArithmeticError) as error:
            stopped = f"it fails there: {error.__cause__ or error}"
        time = self.pore.time if self.pore else 0.0
        return Outlook(time, stopped, self.contact, perf_counter() - start)

    def _run(self, report: Callable[[float], None]) -> None:
        nodes = []
        started = perf_counter()
        for state, _ in steps(self.scene):
            before, self.pore = self.pore, state.pore
            nodes.append(len(state.pore.mesh.points))
            self.node_growth = max(nodes) / nodes[0]
            if self.contact is None and state.pore.contact:
                self.contact = state.pore.time
            self.warnings = {each.key: each for each in warn_surface(state.pore)} | self.warnings
            ended = perf_counter()
            if before is not None and state.pore.time > before.time:
                self.steps.append((state.pore.time - before.time, ended - started))
            started = ended
            report(state.pore.time)


def sketched(scene: Scene) -> Scene:
    """The scene with the numbers of the preset ``sketch`` and a row at its end alone.

    A scene with the paper's scheme is run with the curved one. Stored substrates need updates of
    the shape.
    """
    numerics = scene.numerics
    scheme = numerics.scheme if numerics.scheme.order == CURVED.order else CURVED
    stores = transport_in_time(numerics.transport).stores
    scheme = replace(scheme, steps="updates" if stores else "midpoint")
    coarse: dict[str, Any] = {"contact_elements": 0.0, **PRESETS["sketch"]}
    numerics = replace(numerics, preset="sketch", **coarse, exchanged=scheme)
    end = scene.growth.end
    output = replace(scene.output, times=(end,), every=None)
    return replace(scene, numerics=numerics, output=output)
