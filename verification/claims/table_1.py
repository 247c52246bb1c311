"""C27, C28: the concentrations' scale, and what Table 1 says of F and of the diffusivities."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from repro.model import transport
from repro.model.kinetics import Sink
from verification.claims import ARITHMETIC, CLOSED, Finding, at_most, claim, interval, printed
from verification.claims.restored import solved_pore
from verification.claims.runs import BASE, at, scene, series

PLOTTED = 19.2
SUBSTRATES = ("acceptor", "donor")
#: Base to 10 h in the preset "fast": the identity to show does not depend on mesh and step.
SHORT = ("base", 'numerics.preset="fast"', "numerics.tolerance=0.0075", "numerics.refinement=0.2", 'growth.end="10 h"',
         'output.times=["2 h", "4 h", "6 h", "8 h", "10 h"]')


def scaled(acceptor: float, donor: float) -> tuple[str, ...]:
    """Changes that multiply the supply, 10 mg/L, and K_s, 1 mg/L, of each substrate."""
    return tuple(f'substrates.{name}.{key}="{value * factor!r} mg/L"'
                 for name, factor in zip(SUBSTRATES, (acceptor, donor))
                 for key, value in (("supply", 10.0), ("half_saturation", 1.0)))


#: Everything in mg/L times 8; each substrate by its own factor, with k, Y, F and d_c, which turn one into the other in
#: (7)-(9); C and K_s alone. Powers of two are exact in floating point: with others, round-off can decide a remesh.
ALL_BY_8 = (*SHORT, *scaled(8.0, 8.0), 'kinetics.maximum_density="240000 mg/L"')
EACH = (*SHORT, *scaled(8.0, 4.0), 'kinetics.maximum_utilization_rate="37.2 1/day"',
        f"kinetics.yield_coefficient={0.61 / 4!r}", f"kinetics.acceptor_to_donor_ratio={1.52 * 2!r}",
        f"kinetics.decay_oxygen_demand={1.42 * 8!r}")
ALONE = (*SHORT, *scaled(8.0, 8.0))
COMPARED = ("mean_velocity_m_per_d", "aggregate_area_um2", "upstream_um", "downstream_um", "inert_fraction")


@claim("C27", "2.2", "only the ratios C/K_s matter when K_s is set to 1", about=CLOSED)
def ratios() -> Finding:
    """Base to 10 h with supply and K_s, and what is needed besides, multiplied, against itself.

    Compared in every row: velocity, area, ends, inert fraction, and C / K_s of effluents and at the meshed inlet.
    """
    why = "exact; 1e-8 for the round-off of 50 updates with remeshes"
    checks = (at_most("C, K_s and X_m times 8: largest relative change", "none", change(ALL_BY_8, 8.0, 8.0), 1e-8, why),
              at_most("C and K_s times 8 and 4, with k, Y, F, d_c: largest relative change", "none",
                      change(EACH, 8.0, 4.0), 1e-8, why))
    return Finding(checks, change="the ratios C/K_s are not all: (7)-(8) also hold X_m/K_sA and X_m/K_sD, so that X_m "
                   "must be scaled too, or k, Y, F and d_c where the two K_s differ",
                   note=_alone)


def _alone() -> str:
    """What C and K_s do without X_m, in words."""
    plain, alone = (at(run, 10.0)["effluent_acceptor_mg_per_L"] for run in (SHORT, ALONE))
    return (f"With C and K_s times 8 and nothing else, the acceptor leaves at 10 h with {alone / 8:.3f} K_s instead of "
            f"{plain:.3f}.")


def change(run: tuple[str, ...], acceptor: float, donor: float) -> float:
    """Largest difference of a compared column from the run that is not scaled, in any row, over its largest."""
    ours, plain = series(*run), series(*SHORT)
    factors = dict.fromkeys(COMPARED, 1.0) | {f"{where}_{name}_mg_per_L": factor for where in ("inlet", "effluent")
                                              for name, factor in zip(SUBSTRATES, (acceptor, donor))}
    return max(float(np.abs(ours[key] / factor - plain[key]).max() / np.abs(plain[key]).max())
               for key, factor in factors.items())


#: COD of phenol as printed (it is in no scene), half a last digit of what Table 1 prints, atomic weights.
COD, HALF_DIGIT = 2.38, 0.005
WEIGHT = {"C": 12.011, "H": 1.008, "O": 15.999, "N": 14.007}
#: F from the entries of Table 1.
F_COMPUTED = COD - 0.61 * 1.42
F_OTHER = ("base", f"kinetics.acceptor_to_donor_ratio={F_COMPUTED!r}", f'growth.end="{PLOTTED} h"',
           f'output.times=["{PLOTTED} h"]')


@claim("C28", "Table 1", "F = COD - Y d_c; diffusivity in the aggregate 80 % of that in water", about=CLOSED)
def table_1() -> Finding:
    """F from Table 1's own entries and from chemical formulas; ratios of diffusivities; what F's error does to base."""
    said = scene(*BASE)
    law, paper = said.kinetics, said.kinetics.acceptor_to_donor_ratio
    y, d_c = law.yield_coefficient, law.decay_oxygen_demand
    value, from_formulas = COD - y * d_c, oxygen_demand(6, 6, 1, 0, 7) - y * oxygen_demand(5, 7, 2, 1, 5)
    checks = [printed("COD - Y d_c from the printed values (mg/mg)", f"{paper}", value, rests_on=ARITHMETIC,
                      input="acceptor_to_donor_ratio")]
    for name in SUBSTRATES:
        substrate = getattr(said.substrates, name)
        ratio = substrate.diffusivity_in_aggregate / substrate.diffusivity
        checks.append(printed(f"{name}: diffusivity, aggregate over water (%)", "80", 100 * ratio, rests_on=ARITHMETIC))
    near = (COD + HALF_DIGIT, y, d_c - HALF_DIGIT)
    rounding = (f"COD {near[0]:.3f}, Y {near[1]:.3f} and d_c {near[2]:.3f} round to the printed ones and give "
                f"{near[0] - near[1] * near[2]:.4f}")
    low, high = interval(f"{paper}")
    note = (f"Table 1's entries give {value:.4f} [E1]; with C6H6O + 7 O2 and C5H7O2N + 5 O2 for COD and d_c it is "
            f"{from_formulas:.4f}. ")
    return Finding(tuple(checks), reason=f"Table 1's own COD, Y and d_c give {value:.4f} [E1]",
                   rounding=rounding if low <= near[0] - near[1] * near[2] <= high else "",
                   note=lambda: note + effect_of_f())


def oxygen_demand(carbon: int, hydrogen: int, oxygen: int, nitrogen: int, molecules: int) -> float:
    """mg of O2 that oxidise a mg of a compound, a molecule of which takes so many molecules of O2."""
    mass = sum(count * WEIGHT[atom] for atom, count in zip("CHON", (carbon, hydrogen, oxygen, nitrogen)))
    return molecules * 2 * WEIGHT["O"] / mass


def effect_of_f() -> str:
    """Base at 19.2 h with F as computed: a run of its own, and the effluents in one and the same geometry."""
    ours, other = at(BASE, PLOTTED), at(F_OTHER, PLOTTED)
    told = ", ".join(f"{name} {100 * (other[key] / ours[key] - 1):+.2f} %" for name, key in
                     (("velocity", "mean_velocity_m_per_d"), ("area", "aggregate_area_um2"),
                      *((f"effluent {name}", f"effluent_{name}_mg_per_L") for name in SUBSTRATES)))
    now, solved = solved_pore(BASE, PLOTTED)
    kinetics = replace(scene(*BASE).kinetics, acceptor_to_donor_ratio=F_COMPUTED)
    problem = replace(solved.problem, kinetics=kinetics)
    sink = Sink(now.active)
    state = transport.steady(problem, sink, solved.concentrations)
    pairs = zip(solved.fluxes, transport.fluxes(problem, sink, state))
    alone = ", ".join(f"{name} {100 * (b.effluent / a.effluent - 1):+.2f} %" for name, (a, b) in zip(SUBSTRATES, pairs))
    return f"Base at {PLOTTED} h with {F_COMPUTED:.4f}: {told}; in one and the same geometry the effluents: {alone}."
