"""Wide after contact with the opposite wall: error against time of the presets and of the paper's scheme."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from repro.march.simulation import simulate
from repro.runs.machine import source_hash
from repro.scene import load_scene
from verification.bench import record
from verification.bench.record import clock, measured
from verification.bench.runs import BY_MINUTES, PRESET_PAPER
from verification.claims.levels import converged
from verification.claims.runs import until
from verification.problems.runs import QUADRATIC, after_contact

#: Times of the numbers (h), and that of the diagram.
TIMES, DRAWN = (35.0, 39.3, 45.0), 39.3
#: The same for the quick version, a pore of 25 um.
QUICK_TIMES, QUICK_DRAWN, QUICK = (17.5, 18.0), 18.0, ('pore.width="25 um"',)
#: Sizes of the reference's elements and steps over those of the preset accurate, the finest first.
REFERENCE, QUICK_REFERENCE = (0.5, 2**-0.5), (2**0.5, 2.0)
#: Refinement and time step (min) of the paper's scheme.
PAPER = ((0.7, 24), (1.0, 24), (1.0, 12), (1.4, 12), (1.4, 6))
#: Refinements with which the presets fast and accurate run, in addition to their own.
REFINEMENTS = {"fast": (0.15, 0.3), "accurate": (0.35, 0.6)}
#: The numbers, as :func:`verification.problems.runs.after_contact` lists them.
NUMBERS = ("conductivity", "upstream tip", "downstream tip", "length of contact")
#: Largest accepted error of each preset after contact.
AIMS = {"fast": 0.01, "accurate": 0.002, "exact": 0.0005}


def wide_part(quick: bool) -> dict:
    """Wide: the largest error of conductivity, tips and length of contact at 39.3 h against the time to 39.3 h. The
    errors at all times are kept.

    ``quick``: a pore of 25 um at 18 h, against coarser levels.
    """
    changes, times, drawn = (QUICK, QUICK_TIMES, QUICK_DRAWN) if quick else ((), TIMES, DRAWN)
    about = reference(QUICK_REFERENCE, times, changes) if quick else _known() or reference(REFERENCE, times, changes)
    truth = np.array(about["reference_values"])
    jobs = {(method, label): partial(judged, truth, times, drawn, (*changes, *own))
            for method, label, own in methods(quick)}
    return {"title": f"Wide at {drawn:g} h, after contact, nothing written", "repeats": 1, "lines": measured(jobs, 1),
            "error": f"largest of four numbers at {drawn:g} h: conductivity, tips, length of contact", **about}


def methods(quick: bool) -> list[tuple[str, str, tuple[str, ...]]]:
    """Method, label and changes of the scene of each job."""
    rows = [(f"preset {preset}", "as it is", (f"numerics.preset={preset}",)) for preset in QUADRATIC]
    text, *keys = BY_MINUTES
    paper = [(PRESET_PAPER, text.format(*size), ("numerics.preset=paper", *map(str.format, keys, size)))
             for size in PAPER]
    varied = [(f"preset {preset}", f"refinement {refinement:g}",
               (f"numerics.preset={preset}", f"numerics.refinement={refinement}"))
              for preset, refinements in REFINEMENTS.items() for refinement in refinements]
    return [*rows[:2], paper[0]] if quick else [*rows, *varied, *paper]


def judged(truth: np.ndarray, times: Sequence[float], drawn: float, changes: Sequence[str]) -> dict:
    """The errors of a run; the time after ``drawn`` is set apart."""
    values, at_drawn, end = numbers(times, drawn, changes)
    errors = np.abs(values / truth - 1)
    seconds, cpu = end - at_drawn
    return {"error": float(errors[times.index(drawn)].max()), "errors": errors.tolist(), "apart_seconds": seconds,
            "apart_cpu": cpu}


def numbers(times: Sequence[float], drawn: float, changes: Sequence[str]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(times, 4) numbers of a run, and the clock at ``drawn`` and at the end."""
    rows, clocks = [], []
    for instant in simulate(load_scene("wide", [*changes, *until(*times)])):
        if instant.pore.time > 0:
            rows.append([*after_contact(instant).values()])
            clocks.append(clock())
    return np.array(rows), clocks[list(times).index(drawn)], clock()


def reference(sizes: Sequence[float], times: Sequence[float], changes: Sequence[str]) -> dict:
    """The package's own values on its finest level, and the change of each from the level before."""
    finest, before = (numbers(times, times[-1], (*changes, *converged(size)))[0] for size in sizes)
    change = np.abs(before / finest - 1)
    return {"reference": f"the package itself with elements and steps {sizes[0]:.2g} times those of the preset "
                         f"accurate (small elements beside contact lines); from {sizes[1]:.2g} times on the numbers "
                         f"change by at most {change.max():.1e}",
            "reference_source": source_hash(), "reference_values": finest.tolist(),
            "reference_changes": change.tolist()}


def _known() -> dict:
    """The recorded reference, if it belongs to the present source; else nothing."""
    previous = record.load()["parts"].get("wide", {})
    if previous.get("reference_source") != source_hash():
        return {}
    return {key: value for key, value in previous.items() if key.startswith("reference")}
