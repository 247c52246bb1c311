"""Supplies that change over time: starvation and recovery of an aggregate, against its averaged pore."""

from __future__ import annotations

import json

import numpy as np

from verification.kernel.case import Outcome, Profile, at_least, at_most, case
from verification.problems import runs

#: Diffusivities are so many times those of the paper: the averaged pore's own error falls as their inverse.
FASTER = 64.0
#: (end (h), supply of the donor (mg/L) at the start of the piece, and at its end).
JUMPS = ((2.0, 10.0, 10.0), (4.5, 0.0, 0.0), (7.0, 10.0, 10.0))
SLOPES = ((2.0, 10.0, 10.0), (4.5, 10.0, 0.0), (7.0, 0.0, 10.0))
#: Rows: while it is fed, at the jump or the bend, starved, at the next one, fed again.
TIMES = (1.0, 2.0, 3.3, 4.5, 5.7, 7.0)
ACCEPTOR = 10.0
#: Cells of the averaged pore, and its accuracy: C is nearly even here. Twice as many cells change the area by 7e-6.
CELLS, FLUID, ACCURACY = 16, 48, 1e-5
THIELE = "the square of the transverse Thiele number: 1.2 % of the area of base over 64; and as much for the elements"
#: Bounds where the supply jumps, and where it changes evenly, by preset.
JUMPING = {preset: (4e-4, THIELE) for preset in ("paper", "fast")}
SLOPING = {"paper": (1e-3, "second order in 12 min: a quarter of it with 6 min"),
           "fast": (5e-3, "half of the 1 % that the preset may err by")}


@case("coupling-averaged-supply", kind="cross-code",
      norm="largest difference at six times in 7 h, rows at jumps and within steps among them: area relative, "
           "effluents and section means of C along the mesh over the acceptor's supply; a seed of 20 um in base at "
           "2.9 m/d, diffusivities times 64",
      claim="An aggregate whose donor is taken away for 2.5 h and given back, at once or evenly, starves and recovers "
            "as its averaged pore (FiPy, solve_ivp) does",
      mutants=("supply-of-the-start", "supply-half-way-of-the-start", "supply-a-step-late", "supply-not-yet",
               "row-of-the-end"), slow=True, ways="1 2 paper fast",
      because="accurate takes the steps of fast, shorter")
def supply() -> Outcome:
    checks, pictures = [], []
    for preset in JUMPING:
        for how, pieces, bounds in (("steps", JUMPS, JUMPING), ("linear", SLOPES, SLOPING)):
            found, drawn = _compared(preset, how, pieces, *bounds[preset])
            checks += found
            pictures += drawn
    return Outcome(tuple(checks), (), tuple(pictures))


def _compared(preset: str, how: str, pieces, bound: float, origin: str) -> tuple[list, list[Profile]]:
    """Checks and pictures of one preset and one course of the donor's supply."""
    made = scene(preset, how, pieces)
    instants = runs.ours(made)
    moments = reference(made, pieces)
    rows = [runs.apart(made, *pair) for pair in zip(instants, moments)]
    worst = runs.worst(rows)
    checks = [at_most(f"{name}, {how}, {preset}", worst[name], bound, origin)
              for name in ("area", "effluents", "C along the pore")]
    areas = [moment.area for moment in moments]
    if how == "steps":
        checks.append(at_least(f"area at 2 h over that at 4.5 h, {preset}", areas[1] / areas[3], 1.005,
                               "decay over 2.5 h: else nothing is starved"))
    time = np.array(TIMES)
    ours = np.array([instant.pore.outline.area for instant in instants])
    curves = (("ours", "ours", time, ours), ("averaged", "reference", time, np.array(areas)))
    return checks, [Profile(f"{how}, {preset}", "time (h)", "area (um2)", curves)]


def scene(preset: str, how: str, pieces):
    """Base with a donor whose supply changes."""
    table = [["0 h", f"{pieces[0][1]} mg/L"]]
    for (end, _, _), (_, first, _) in zip(pieces, pieces[1:]):
        table.append([f"{end} h", f"{first} mg/L"])
    table += [[f"{pieces[-1][0]} h", f"{pieces[-1][2]} mg/L"]]
    made = runs.base("7 h", runs.by(preset), 'aggregate.radius="20 um"', f"substrates.donor.supply={json.dumps(table)}",
                     f"substrates.donor.interpolation={how}", times=", ".join(f'"{time} h"' for time in TIMES))
    made = runs.with_diffusivities(made, lambda water, biomass: (FASTER * water, FASTER * biomass))
    return runs.at_velocity(made, runs.SPEED)


def reference(made, pieces) -> list:
    """The averaged pore's moments at the reported times."""
    both = [(end, (ACCEPTOR, first), (ACCEPTOR, last)) for end, first, last in pieces]
    return runs.half_disc(made.at(0.0), cells=CELLS, fluid=FLUID).run_through(both, TIMES, ACCURACY)
