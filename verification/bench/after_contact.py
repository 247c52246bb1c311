"""Wide after contact with the opposite wall: error against time of the presets and of the paper's scheme.

The reference of the conductivity is NGSolve's, on the outlines that `exact` has at the same times
(:mod:`reference.gold_flow`). No other code has computed the whole run, so the tips and the length of contact are
compared with the finest level of the package.
"""

from collections.abc import Sequence
from functools import partial

import numpy as np

from reference import gold_flow
from repro.march.simulation import simulate
from repro.runs.machine import source_hash
from repro.scene import load_scene
from verification.bench.record import clock, measured, reference_of
from verification.bench.runs import BY_MINUTES, PRESET_PAPER
from verification.claims.levels import converged
from verification.claims.runs import until
from verification.problems.hard import clean_conductivity
from verification.problems.runs import QUADRATIC, after_contact

#: Times of the numbers (h), and that of the diagram.
TIMES, DRAWN = (35.0, 39.3, 45.0), 39.3
#: Sizes of the reference's elements and steps over those of the preset accurate, the finest first.
REFERENCE = (0.5, 2**-0.5)
#: Refinement and time step (min) of the paper's scheme.
PAPER = ((0.7, 24), (1.0, 24), (1.0, 12), (1.4, 12), (1.4, 6))
#: Refinements with which the presets fast and accurate run, in addition to their own.
REFINEMENTS = {"fast": (0.15, 0.3), "accurate": (0.35, 0.6)}
#: The numbers, as :func:`verification.problems.runs.after_contact` lists them.
NUMBERS = ("conductivity", "upstream tip", "downstream tip", "length of contact")
#: Largest accepted errors of each preset, in the order of NUMBERS. Until 2026-11-30 they were 1, 0.2 and 0.05 % for all
#: numbers.
AIMS = {"fast": (4e-3, 2e-4, 2e-4, 4e-3), "accurate": (1e-3, 2e-4, 2e-4, 1.5e-3), "exact": (5e-4, 2e-4, 2e-4, 5e-4)}


def wide_part() -> dict:
    """Wide: the largest error of conductivity, tips and length of contact at 39.3 h against the time to 39.3 h. The
    errors at all times are kept."""
    about = reference_of("wide", "reference_source", source_hash()) or reference()
    truth = np.array(about["reference_values"])
    jobs = {(method, label): partial(judged, truth, changes) for method, label, changes in methods()}
    return {"title": f"Wide at {DRAWN:g} h, after contact, nothing written", "repeats": 1, "lines": measured(jobs, 1),
            "error": f"largest of four numbers at {DRAWN:g} h: conductivity, tips, length of contact", **about}


def methods() -> list[tuple[str, str, tuple[str, ...]]]:
    """Method, label and changes of the scene of each job."""
    rows = [(f"preset {preset}", "as it is", (f"numerics.preset={preset}",)) for preset in QUADRATIC]
    rows += [(f"preset {preset}", f"refinement {refinement:g}",
              (f"numerics.preset={preset}", f"numerics.refinement={refinement}"))
             for preset, refinements in REFINEMENTS.items() for refinement in refinements]
    text, *keys = BY_MINUTES
    return rows + [(PRESET_PAPER, text.format(*size), ("numerics.preset=paper", *map(str.format, keys, size)))
                   for size in PAPER]


def judged(truth: np.ndarray, changes: Sequence[str]) -> dict:
    """The errors of a run; the time after DRAWN is not counted."""
    values, at_drawn, end = numbers(changes)
    errors = np.abs(values / truth - 1)
    seconds, cpu = end - at_drawn
    return {"error": float(errors[TIMES.index(DRAWN)].max()), "errors": errors.tolist(), "apart_seconds": seconds,
            "apart_cpu": cpu}


def numbers(changes: Sequence[str]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(times, 4) numbers of a run, and the clock at DRAWN and at the end."""
    rows, clocks = [], []
    for instant in simulate(load_scene("wide", [*changes, *until(*TIMES)])):
        if instant.pore.time > 0:
            rows.append([*after_contact(instant).values()])
            clocks.append(clock())
    return np.array(rows), clocks[TIMES.index(DRAWN)], clock()


def reference() -> dict:
    """Conductivities of NGSolve, tips and lengths of the package's finest level, and the uncertainty of each number:
    the difference of the finest level from NGSolve, or its change from the level before."""
    finest, before = (numbers(converged(size))[0] for size in REFERENCE)
    conductivity = NUMBERS.index("conductivity")
    values = finest.copy()
    values[:, conductivity] = gold_conductivities()
    before[:, conductivity] = values[:, conductivity]
    changes = np.abs(before / finest - 1)
    to_gold, to_before = (100 * part.max() for part in np.split(changes, [conductivity + 1], axis=1))
    return {"reference": f"conductivity of NGSolve on the outlines of exact, {to_gold:.2g} % from the package's finest "
                         f"level at most; tips and length of this level, with elements and steps {REFERENCE[0]:.2g} "
                         f"times those of the preset accurate; from {REFERENCE[1]:.2g} times on they change by at "
                         f"most {to_before:.2g} %",
            "reference_source": source_hash(), "reference_values": values.tolist(),
            "reference_changes": changes.tolist()}


def gold_conductivities() -> np.ndarray:
    """Conductivities (m/day) of NGSolve at TIMES."""
    scene = load_scene("wide")
    clean = clean_conductivity(scene)
    added = [gold_flow.added(f"wide, {time:g} h", "laplacian").length for time in TIMES]
    return np.array([clean / (1 + length / scene.pore.length) for length in added])
