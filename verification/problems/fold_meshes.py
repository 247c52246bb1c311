"""Ends of the family's runs on other meshes and with stress-free biomass.

    python -m verification.problems.fold_meshes 12 13 41 --limit 60

A member runs with the preset fast. Its last state with a stretch above BEGUN continues on each of MESHES. Another
preset also has another time tolerance. With stress-free biomass the member runs from t = 0. Each run has a limit of
processor time. A line of the record has the member, and the end, time (h) and least stretch of each run.
"""

import argparse
import json
from collections.abc import Iterable
from pathlib import Path

from repro.errors import SimulationError
from repro.march import simulation
from repro.march.ends import PoreEnd
from repro.march.folding import Fold
from repro.march.state import RestartState
from repro.model import remeshing
from repro.model.remeshing import Remeshing
from repro.scene import Scene
from verification.evidence.writing import append
from verification.problems.family import draw_member
from verification.problems.hard import TooLong, limited

#: Least stretch at which runs on other meshes begin. The surface is smooth, long before the first crease.
BEGUN = 0.75
#: Where boundary layers require about 0.4, smaller refinements change only the elements in films.
MESHES = {"fast, refinement 0.45": ("numerics.refinement=0.45",), "accurate": ("numerics.preset=accurate",),
          "accurate, refinement 0.7": ("numerics.preset=accurate", "numerics.refinement=0.7")}
STRESS_FREE = "growth.new_biomass=stress_free"


def follow(scene: Scene, limit: float, state: RestartState | None = None) -> tuple[dict, RestartState | None]:
    """(end, time and least stretch) of a run, and its last state with a stretch above BEGUN."""
    last = above = state
    end = "end"
    try:
        with limited(limit):
            for last, _ in simulation.steps(scene, state):
                if last.compression.stretch > BEGUN:
                    above = last
    except (Fold, PoreEnd, SimulationError, TooLong) as error:
        end = f"{type(error).__name__}: {error}"
    reached = {"time_h": last.pore.time, "stretch": last.compression.stretch} if last else {}
    return {"end": end, **reached}, above


def on_mesh_of(scene: Scene, state: RestartState) -> RestartState:
    """The state in a new mesh of a scene."""
    pore = remeshing.remesh(Remeshing.of(scene), state.pore, state.pore, 0.0)[0]
    return RestartState(pore, state.step_control, compression=state.compression)


def study(number: int, limit: float) -> dict[str, object]:
    """The ends of all runs of a member. Those on other meshes are left out if the stretch stays above BEGUN."""
    member = draw_member(number)
    first, above = follow(member.scene(*member.duration), limit)
    ends: dict[str, object] = {"number": number, "fast": first}
    if above is not None and first["stretch"] <= BEGUN:
        for name, changes in MESHES.items():
            scene = member.scene(*member.duration, *changes)
            ends[name], _ = follow(scene, 4 * limit, on_mesh_of(scene, above))
    ends["stress_free"], _ = follow(member.scene(*member.duration, STRESS_FREE), limit)
    return ends


def main(numbers: Iterable[int], limit: float, record: Path) -> None:
    """Print a line for each member, and add it to the record."""
    for number in numbers:
        row = study(number, limit)
        print(json.dumps(row), flush=True)
        append(row, record)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("numbers", type=int, nargs="+")
    parser.add_argument("--limit", type=float, default=60.0)
    parser.add_argument("--record", type=Path, required=True)
    options = parser.parse_args()
    main(options.numbers, options.limit, options.record)
