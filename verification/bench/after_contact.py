"""Wide after contact with the opposite wall: error against time of the presets and of the paper's scheme."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from repro.march.simulation import simulate
from repro.runs.machine import source_hash
from repro.scene import load_scene
from verification.bench.record import clock, measured, reference_of
from verification.bench.runs import BY_MINUTES, PRESET_PAPER
from verification.claims.levels import converged
from verification.claims.runs import until
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
#: Largest accepted error of each preset after contact.
AIMS = {"fast": 0.01, "accurate": 0.002, "exact": 0.0005}


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
    """The package's own values on its finest level, and the change of each from the level before."""
    finest, before = (numbers(converged(size))[0] for size in REFERENCE)
    change = np.abs(before / finest - 1)
    return {"reference": f"the package itself with elements and steps {REFERENCE[0]:.2g} times those of the preset "
                         f"accurate (small elements beside contact lines); from {REFERENCE[1]:.2g} times on the "
                         f"numbers change by at most {change.max():.1e}",
            "reference_source": source_hash(), "reference_values": finest.tolist(),
            "reference_changes": change.tolist()}
