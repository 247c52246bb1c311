"""C48, C49: the range in which the smooth shape of the aggregate has the least energy, and whether the aggregate
reaches the expansion that the paper expects within this range.

Both are judged in three scenes: base under its constant head to 76 h (C43), wide, and a pore as wide as wide's, four
times as long, with a seed of 10 um and a tenth of the velocity. The supply of 10 mg/L is the same in all of them. When
the definitions were written, the slow pore was known to end as a fold with a stretch of 0.64 to 0.66; the expansions
were not known.
"""

from dataclasses import dataclass, replace
from math import inf

import numpy as np

from repro.errors import RunEnd
from repro.march import simulation
from repro.march.state import Report
from repro.model.energies.neo_hookean import CREASE
from repro.model.surface import surface
from verification import sensitivity
from verification.claims import Dependence, Finding, PaperCheck, at_least, between, claim, without_limit
from verification.claims.growth_mechanics import TOTAL
from verification.claims.levels import BESIDE_PAIRS, cached
from verification.claims.permeability import CLOSING
from verification.claims.runs import WIDE, Run, body_of, load_packaged, until
from verification.problems import family
from verification.uncertainty import Bar

#: A wide, slow pore, in which the rim grows on a starved core.
SLOW = ("wide", 'pore.length="2.4 mm"', 'aggregate.radius="10 um"', 'flow.mean_velocity="0.3 m/day"',
        *until(*range(3, 91, 3)))
SCENES: dict[str, Run] = {"base": CLOSING, "wide": WIDE, "slow pore": SLOW}
#: Sizes of the elements. With 2.83, as in other claims of paired runs, a triangle of the slow pore collapses at 4.6 h.
SMALLER = tuple(1.8 * 2 ** (third / 3) for third in (-1, 0, 1))
#: When both definitions were written, and when the meanings of their words were.
DEFINED, MEANT = "2026-11-25 22:42", "2026-11-30 10:45"


@dataclass(frozen=True)
class StretchHistory:
    """A run by its rows: hours (n,), least elastic stretch of the free surface (n,), largest expansion of a triangle
    (n,), the largest over the smallest in the last row, and the message of the RunEnd that ended the run, or ""."""

    hours: np.ndarray
    stretch: np.ndarray
    expansion: np.ndarray
    spread: float
    ended: str


@cached
def stretch_history(*run: str) -> StretchHistory:
    """Compute a run to its end, which may be a fold."""
    scene = load_packaged(*run)
    reports: list[Report] = []
    ended = ""
    try:
        reports.extend(report for _, report in simulation.steps(scene) if report)
    except RunEnd as end:
        ended = str(end)
    stretch = np.array([surface(report.pore).least for report in reports])
    means = [body_of(scene, report).mean(report.pore.body.theta) for report in reports]
    return StretchHistory(np.array([report.pore.time for report in reports]), stretch,
                          np.array([m.max() for m in means]), float(means[-1].max() / means[-1].min()), ended)


def smooth_expansion(run: StretchHistory) -> float:
    """The largest expansion while the least stretch is at least CREASE; expansions grow exponentially between rows."""
    below = np.flatnonzero(run.stretch < CREASE)
    if not len(below):
        return float(run.expansion.max())
    rows = slice(below[0] - 1, below[0] + 1)
    return float(np.exp(np.interp(-CREASE, -run.stretch[rows], np.log(run.expansion[rows]))))


@claim("C48", "5", "the deterministic approach leads to biological masses with a smooth outer surface, since the "
       "potential energy of the aggregate is kept to a minimum", fine=SMALLER, beside=BESIDE_PAIRS, date=MEANT)
def smooth_surface() -> Finding:
    """The least elastic stretch along the free surface, in all rows of each scene. Under 0.647 a crease has less energy
    than the smooth surface of a neo-Hookean half-space (Hohlfeld and Mahadevan 2011; Hong, Zhao and Suo 2009), and the
    smooth shape is no minimum. The paper's pores are base and wide; the third one is our choice, and so are the pores
    drawn at random in `verification.problems.family`, whose folds the note counts."""
    checks = tuple(_least(name) for name in SCENES)
    holds = {check.quantity.partition(":")[0]: check.value >= CREASE for check in checks}
    return Finding(checks, reason=_ends(), note=lambda: f"{_drawn()} {_stretches()}",
                   dependence=Dependence("the pore", holds))


def _drawn() -> str:
    """Count the folds among the pores drawn at random, by their drive."""
    rows = list(family.read_record().values())
    counts = []
    for drive in family.DRIVES:
        driven = [row for row in rows if row["drive"] == drive]
        folds = sum(row["verdict"] == family.FOLD for row in driven)
        early = sum(map(family.ends_before_contact, driven))
        counts.append(f"{folds} of {len(driven)} ({drive}), where {early} runs end before contact")
    return (f"Of the pores drawn at random these fold: {'; '.join(counts)}. A run ends at three times the contact time "
            "of an aggregate that has the supply everywhere, so a longer run may fold.")


def _least(name: str) -> PaperCheck:
    least = stretch_history(*SCENES[name]).stretch.min()
    return without_limit(at_least(f"{name}: least elastic stretch along the free surface", "smooth, at least energy",
                                  least, CREASE, "under it a crease has less energy"))


@claim("C49", "2.3.1", "expansion by up to 2000, after a couple of days, can be handled, also where the aggregate "
       "grows unevenly", fine=SMALLER, beside=BESIDE_PAIRS, date=MEANT)
def uneven_expansion() -> Finding:
    """The largest expansion of a triangle in wide, as long as the smooth surface has the least energy (C48), and the
    time at which it is 2000; and the time at which the slow pore's surface is smooth no more. As in C25, "up to 2000"
    is judged as reaching 2000, and depends on the supply of wide."""
    wide, slow = (stretch_history(*SCENES[name]) for name in ("wide", "slow pore"))
    checks = (at_least("wide: largest expansion under a smooth surface of least energy", "up to 2000",
                       smooth_expansion(wide), TOTAL, "as stated"),
              reached_time("wide"),
              at_least("slow pore: time to which its surface is smooth (h)", "a couple of days", smooth_until(slow), 72,
                       "three days, as in C25"))
    return Finding(tuple(map(without_limit, checks)), reason=f"{_unreached()}{_ends()}", note=_stretches,
                   dependence=sensitivity.on_supplies("C25"))


def smooth_until(run: StretchHistory) -> float:
    """The last time (h) at which the least stretch is at least CREASE, linear between rows; the end of the run if it
    never falls below."""
    below = np.flatnonzero(run.stretch < CREASE)
    if not len(below):
        return float(run.hours[-1])
    rows = slice(below[0] - 1, below[0] + 1)
    return float(np.interp(-CREASE, -run.stretch[rows], run.hours[rows]))


def reached_time(name: str) -> PaperCheck:
    """The time at which the expansion is 2000; the end of the run, without an upper end, if the run ends before."""
    run = stretch_history(*SCENES[name])
    expansion = np.maximum.accumulate(run.expansion)
    time = float(np.interp(np.log(TOTAL), np.log(expansion), run.hours))
    check = between(f"{name}: time at which the expansion is 2000 (h)", "a couple of days", time, 24, 72,
                    "one to three days, as in C25")
    return check if expansion[-1] >= TOTAL else replace(check, bar=Bar(time, inf))


def _unreached() -> str:
    """Name the scenes whose expansion is never 2000."""
    runs = {name: stretch_history(*SCENES[name]) for name in ("wide", "slow pore")}
    return "".join(f"the expansion of {name} is not 2000 until its end at {run.hours[-1]:.1f} h, where it is "
                   f"{run.expansion.max():.4g}; " for name, run in runs.items() if run.expansion.max() < TOTAL)


def _ends() -> str:
    """Describe the ends of the scenes that stop before their last row."""
    ends = "; ".join(f"{name}: {run.ended}" for name in SCENES if (run := stretch_history(*SCENES[name])).ended)
    return f"growth compresses the surface of a rim that grows on a starved core. {ends}"


def _stretches() -> str:
    parts = [f"{name} to {run.hours[-1]:.3g} h: stretch {run.stretch.min():.3f}, expansion {run.expansion.max():.3g}, "
             f"{run.spread:.3g} times the smallest one" for name in SCENES for run in [stretch_history(*SCENES[name])]]
    return "; ".join(parts) + "."
