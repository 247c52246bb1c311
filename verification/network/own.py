"""The laws for networks with other kinetics than those of Table 1: two scenes, judged with states of another seed.

`python -m verification.network own` writes the record. The scenes and the rule precede the solutions: a law holds for a
scene if every state of the other seed is within its bound.
"""

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from repro.network import own, uptakes
from repro.scene import Scene, load_scene

RECORD = Path(__file__).with_name("own.json")
#: Seed of the states that judge the laws.
SEED = 20261130
SLOW = {"pore": {"width": "60 um"}, "aggregate": {"radius": "6 um"}, "flow": {"mean_velocity": "1 m/day"},
        "substrates": {"acceptor": {"supply": "8 mg/L", "half_saturation": "0.2 mg/L"},
                       "donor": {"supply": "6 mg/L", "half_saturation": "0.5 mg/L", "diffusivity": "0.9 cm^2/day",
                                 "diffusivity_in_aggregate": "60 %"}},
        "kinetics": {"maximum_utilization_rate": "4.3 1/day", "yield_coefficient": 0.4,
                     "decay_coefficient": "0.2 1/day"}, "growth": {"end": "120 h"}}
FAST = {"pore": {"width": "80 um"}, "aggregate": {"radius": "8 um"}, "flow": {"mean_velocity": "2 m/day"},
        "substrates": {"acceptor": {"supply": "10 mg/L", "half_saturation": "0.1 mg/L"},
                       "donor": {"supply": "10 mg/L", "half_saturation": "5 mg/L"}},
        "kinetics": {"maximum_utilization_rate": "20 1/day", "maximum_density": "60000 mg/L"},
        "growth": {"end": "40 h"}}
#: Scenes by their names on the page: slower and faster uptake than that of Table 1.
SCENES = {"slow": SLOW, "fast": FAST}


def judged(scene: Scene, table: own.Table, states: np.ndarray) -> Iterator[dict]:
    """Judge the law of a scene, and that of Table 1 with the scene's kinetics, by states (n, 7)."""
    fitted = own._law(scene, table)
    fixed = fitted._replace(transports=uptakes.TRANSPORTS, bound=uptakes.UPTAKE_BOUND)
    for law in (fitted, fixed):
        aggregates = own.throats(law, states)
        apart = np.expm1(np.abs(own.deviations(aggregates, states.T[5:]))).max(axis=0)
        yield {"bound": law.bound, "states": len(apart), "within": int((apart <= aggregates.bound()).sum()),
               "median": float(np.median(apart)), "worst": float(apart.max())}


def write() -> dict:
    """Solve both scenes with both seeds, and write the record."""
    record = {}
    for name, tables in SCENES.items():
        scene = load_scene(tables)
        table = own._fitted(scene, *own.solved(scene, np.random.default_rng(own.SEED)))
        states, shapes = own.solved(scene, np.random.default_rng(SEED))
        laws = dict(zip(("own", "table_1"), judged(scene, table, states)))
        record[name] = {**laws, "share": float(shapes[:, 1].max()), "shapes": shapes.tolist()}
        print(name, laws, flush=True)
    RECORD.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    return record
