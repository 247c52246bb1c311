"""C01-C08: the numbers that section 4 prints for its run, `base`.

Its effluents, uptake and inlet concentrations at 19.4 h are those "before the aggregate expands" (Plate 1): in the
shape of 19.2 h with the biomass that has grown in it since [E12]. The velocity is that of the same shape, since it does
not depend on the density.

C27, C28: the scale of the concentrations, and F and the diffusivities of Table 1.

C09, C18: times that follow from Table 1 alone, and those of the run.

Mesh and time-step independence of `base`.
"""

from math import log

import numpy as np

from repro.model.kinetics import rate_law
from repro.model.pore import Pore
from repro.model.solving import Solved
from verification import sensitivity
from verification.claims import (
    ARITHMETIC,
    CLOSED,
    CONSTRUCTION,
    DIGITS,
    OF_SCHEME,
    REPEATED,
    Finding,
    PaperCheck,
    at_least,
    at_most,
    between,
    claim,
    interval,
    printed,
    without_limit,
)
from verification.claims.levels import ALONE as SINGLE
from verification.claims.levels import BESIDE, DEFAULT, Level, at_level
from verification.claims.runs import (
    BASE,
    END,
    PLOTTED,
    SUBSTRATES,
    at,
    grown,
    grown_on_new_mesh,
    load_packaged,
    series,
    until,
)
from verification.problems.channels import both, pair
from verification.problems.meshes import field_at
from verification.store import map_in_parallel

SUPPLY = 10.0
#: The effluents that the paper prints, and the factor by which it raises them.
PRINTED_EFFLUENTS, CORRECTED = ("4.19", "6.13"), 1.016
#: The paper's distances of the meshed inlet from the aggregate (um): its words; the least of 3.1; that of 210 um [E13].
DISTANCES = (60.0, 65.0, 75.0)


@claim("C01", "4", "mean velocity 2.9 m/d at t = 0")
def velocity_at_first() -> Finding:
    """Mean velocity in the seed's geometry under the head of 1e-3 cm."""
    return Finding((printed("mean velocity at t = 0 (m/d)", "2.9", at(BASE, 0.0)["mean_velocity_m_per_d"],
                            input="velocity_0"),))


@claim("C02", "4", "mean velocity 1.5 m/d at 19.4 h")
def velocity_at_last() -> Finding:
    """Mean velocity in the shape that the paper plots."""
    last = at(BASE, END)["mean_velocity_m_per_d"]
    largest = last * (1 + sensitivity.reach("velocity"))
    change = ("the shape is that of 19.2 h, in which the paper plots its state of 19.4 h [E12]; in the shape of 19.4 h "
              f"itself the velocity is {last:.3f} m/d, outside the printed digits. The rounding of Table 1 does not "
              f"exclude this shape: the velocity reaches {largest:.2f} m/d")
    checks = (printed("mean velocity in the shape of 19.2 h (m/d)", "1.5", at(BASE, PLOTTED)["mean_velocity_m_per_d"],
                      input="velocity"),
              at_least("largest velocity after the expansion at 19.4 h, inputs within their rounding (m/d)",
                       "1.5 in another shape", largest, 1.45, DIGITS))
    return Finding(checks, change=change, reason="the velocity in this shape differs, too")


@claim("C03", "4", "effluent acceptor 4.19 K_s, donor 6.13 K_s at 19.4 h", date="2026-11-29 17:12")
def effluents() -> Finding:
    """Flow-weighted effluents of the state that the paper plots."""
    effluents = [flux.effluent for flux in grown(BASE, PLOTTED)[1].fluxes]
    checks = tuple(printed(f"effluent {name} (K_s)", text, value, input=f"effluent_{name}")
                   for name, text, value in zip(SUBSTRATES, PRINTED_EFFLUENTS, effluents))
    before = [at(BASE, PLOTTED)[f"effluent_{name}_mg_per_L"] for name in SUBSTRATES]
    raised = [[CORRECTED * end for end in interval(text)] for text in PRINTED_EFFLUENTS]
    checks += tuple(between(f"19.2 h, effluent {name} (K_s)", f"{text} and 1.6 %", value, *bounds,
                            f"{DIGITS}, and the paper's own correction", input=f"effluent_{name}")
                    for name, text, value, bounds in zip(SUBSTRATES, PRINTED_EFFLUENTS, before, raised))
    ratio = (SUPPLY - effluents[0]) / (SUPPLY - effluents[1])
    states = {"19.2 h": before, "19.4 h before the expansion": effluents}
    apart = {when: ", ".join(f"{100 * (value / (CORRECTED * float(text)) - 1):+.1f}" for value, text in zip(
        values, PRINTED_EFFLUENTS)) for when, values in states.items()}
    reason = (f"the printed inputs give effluents of {effluents[0]:.3f} and {effluents[1]:.3f}, and {ratio:.3f} times "
              "as much acceptor as donor is consumed; by the printed effluents it is "
              f"{(SUPPLY - 4.19) / (SUPPLY - 6.13):.3f} times, less than F [E14]")
    reason = "; ".join(filter(None, (reason, sensitivity.nearest_set())))
    return Finding(checks, reason=reason, rounding=sensitivity.verified_set(),
                   note="Raised by the paper's own 1.6 %, its effluents are 4.257 and 6.228. Ours differ from these by "
                   + " and ".join(f"{percents} % at {when}" for when, percents in apart.items()) + " [E18, E24].")


@claim("C04", "4", "about 60 % of the influent acceptor is consumed by then")
def consumed_share() -> Finding:
    """Share of the supplied acceptor that does not leave."""
    share = 1 - grown(BASE, PLOTTED)[1].fluxes[0].effluent / SUPPLY
    return Finding((printed("acceptor consumed (%)", "~60", 100 * share, input="consumed", rests_on=REPEATED,
                            why="half a unit of the one digit of ~60; the paper's own 4.19 gives 58.1"),))


@claim("C05", "4", '"donor" at the inlet of the meshed domain about 7 K_s, that is 60 um away')
def at_the_meshed_inlet() -> Finding:
    """Flow-weighted acceptor at the distances from the aggregate that the paper's words and rules give [E13].

    The mesh is new, because the concentrations near its end depend on the position of (11). The run's own mesh ends 68
    to 73 um from the aggregate, depending on the size. In it the concentrations change by 0.1 % from size to size and
    show no order.
    """
    pore, solved = grown_on_new_mesh(BASE, PLOTTED)
    means = {distance: upstream_means(pore, solved, distance) for distance in DISTANCES}
    checks = tuple(printed(f"acceptor {distance:g} um from the aggregate (K_s)", "~7", pair[0],
                           input=f"acceptor_at_{distance:g}") for distance, pair in means.items())
    donors = ", ".join(f"{pair[1]:.2f} at {distance:g} um" for distance, pair in means.items())
    change = f"the paper names the donor, but the number is the acceptor's [E9]: the donor is {donors}"
    return Finding(checks, change=change, reason="it is not 7 K_s at every distance that the paper may mean")


def upstream_means(pore: Pore, solved: Solved, distance: float) -> np.ndarray:
    """(2,) flow-weighted C_A and C_D at a distance (um) upstream of the aggregate; beyond the mesh by (26)."""
    x, inlet = pore.boundary.upstream - distance, pore.mesh.ends[0]
    part = np.linspace(0.0, 1.0, 201)
    where = np.column_stack([np.full_like(part, max(x, inlet)), part * pore.mesh.width])
    concentrations = field_at(pore.space, both(solved.concentrations).T, where)
    mean = np.trapezoid(6 * part * (1 - part) * concentrations.T, part)
    supply, diffusivity = (np.array(pair(name, solved.problem.substrates)) for name in ("supply", "diffusivity"))
    return supply - (supply - mean) * np.exp(solved.flow.mean_velocity * min(x - inlet, 0.0) / diffusivity)


@claim("C06", "4", "inert remains under 0.5 % of the aggregate's mass at 19.4 h")
def inert_share() -> Finding:
    """Inert over total mass of the aggregate."""
    return Finding((at_most("inert fraction at 19.4 h (%)", "<0.5", 100 * at(BASE, END)["inert_fraction"], 0.5,
                            "the paper's bound", input="inert"),),
                   note="Some inputs within the rounding of Table 1 exceed the bound: see the range of the inputs.")


@claim("C07", "4, Fig 4", "initial meshed domain 110 um long", about=OF_SCHEME)
def first_length() -> Finding:
    """Meshed length around the seed: 2 (R + 10 R)."""
    return Finding((printed("meshed length at t = 0 (um)", "110", at(BASE, 0.0)["meshed_length_um"],
                            rests_on=CONSTRUCTION),))


@claim("C08", "4, Plate 2", "meshed domain 210 um long at 19.4 h", about=OF_SCHEME, sizes=BESIDE, steps=SINGLE,
       fixed="the length is that of the paper's update", date="2026-11-29 16:48")
def last_length() -> Finding:
    """Range of lengths that the rules of 3.1 allow around our aggregate: from extension to generation. The length in a
    run depends on the time of the last remesh, which has no limit as mesh and step are refined."""
    row, width = at(BASE, END), load_packaged(*BASE).pore.width
    span = row["downstream_um"] - row["upstream_um"]
    low, high = (span + 2 * factor * width for factor in (1.3, 1.5))
    half = 0.5 * span * sensitivity.reach("area")
    within = [(length - half, length + half) for length in (low, high)]
    lengths, times = series(*BASE)["meshed_length_um"], series(*BASE)["time_h"]
    last = times[1:][np.diff(lengths) != 0][-1]
    plotted = at(BASE, PLOTTED)
    around_plotted = plotted["downstream_um"] - plotted["upstream_um"] + 3 * width
    change = (f"our meshed part is {row['meshed_length_um']:.0f} um long at 19.4 h, since its last regeneration was at "
              f"{last:g} h. The claim compares the lengths that the rules of 3.1 allow around our aggregate; 210 um is "
              "among them")
    note = (f"A mesh generated at 1.5 W around the shape of 19.2 h is {around_plotted:.1f} um long, and {high:.1f} um "
            "around that of 19.4 h: 210 um is the former, which supports E12.")
    checks = (at_most("least length that 3.1 allows at 19.4 h (um)", "210 or less", low, 210.5,
                      "extended under 1.3 W from the aggregate", rests_on=CONSTRUCTION, within=within[0]),
              at_least("largest length that 3.1 allows at 19.4 h (um)", "210 or more", high, 209.5,
                       "generated at 1.5 W from the aggregate", rests_on=CONSTRUCTION, within=within[1]),
              printed("meshed length generated around the shape of 19.2 h [E12] (um)", "210", around_plotted,
                      rests_on=CONSTRUCTION))
    return Finding(tuple(map(without_limit, checks)), change=change, note=note,
                   reason="it does not hold on every mesh with every step")


#: Base to 10 h in the preset "fast": the identity does not depend on mesh and step.
SHORT = ("base", 'numerics.preset="fast"', "numerics.tolerance=0.0075", "numerics.refinement=0.2",
         *until(2, 4, 6, 8, 10))


def scaled(acceptor: float, donor: float) -> tuple[str, ...]:
    """Changes that multiply the supply, 10 mg/L, and K_s, 1 mg/L, of each substrate."""
    return tuple(f'substrates.{name}.{key}="{value * factor!r} mg/L"'
                 for name, factor in zip(SUBSTRATES, (acceptor, donor))
                 for key, value in (("supply", 10.0), ("half_saturation", 1.0)))


#: Factors of three kinds: 8 for every quantity in mg/L; one for each substrate, with k, Y, F and d_c, which convert one
#: into the other in (7)-(9); and factors of C and K_s alone. Powers of two are exact in floating point. With other
#: factors, round-off can decide a remesh.
ALONE = (*SHORT, *scaled(8.0, 8.0))
ALL_BY_8 = (*ALONE, 'kinetics.maximum_density="240000 mg/L"')
EACH_SUBSTRATE = (*SHORT, *scaled(8.0, 4.0), 'kinetics.maximum_utilization_rate="37.2 1/day"',
        f"kinetics.yield_coefficient={0.61 / 4!r}", f"kinetics.acceptor_to_donor_ratio={1.52 * 2!r}",
        f"kinetics.decay_oxygen_demand={1.42 * 8!r}")
COMPARED = ("mean_velocity_m_per_d", "aggregate_area_um2", "upstream_um", "downstream_um", "inert_fraction")


@claim("C27", "2.2", "only the ratios C/K_s matter when K_s is set to 1", about=CLOSED)
def ratios() -> Finding:
    """Compare base to 10 h with runs in which supply, K_s and, if necessary, other inputs are multiplied.

    Compared in every row: velocity, area, ends, inert fraction, and C / K_s of effluents and at the meshed inlet.
    """
    why = "exact; 1e-8 for the round-off of 50 updates with remeshes"
    checks = (at_most("C, K_s and X_m times 8: largest relative change", "none", change(ALL_BY_8, 8.0, 8.0), 1e-8, why),
              at_most("C and K_s times 8 and 4, with k, Y, F, d_c: largest relative change", "none",
                      change(EACH_SUBSTRATE, 8.0, 4.0), 1e-8, why))
    plain, alone = (at(run, 10.0)["effluent_acceptor_mg_per_L"] for run in (SHORT, ALONE))
    return Finding(checks, change="the ratios C/K_s are not sufficient: (7)-(8) also contain X_m/K_sA and X_m/K_sD. "
                   "X_m must be scaled too, or k, Y, F and d_c if the two K_s differ",
                   note="If C and K_s alone are multiplied by 8, the effluent acceptor at 10 h is "
                   f"{alone / 8:.3f} K_s instead of {plain:.3f}.")


def change(run: tuple[str, ...], acceptor: float, donor: float) -> float:
    """Largest difference of a compared column from the unscaled run in any row, over the largest value of the
    column."""
    scaled, plain = series(*run), series(*SHORT)
    factors = dict.fromkeys(COMPARED, 1.0) | {f"{where}_{name}_mg_per_L": factor for where in ("inlet", "effluent")
                                              for name, factor in zip(SUBSTRATES, (acceptor, donor))}
    return max(float(np.abs(scaled[key] / factor - plain[key]).max() / np.abs(plain[key]).max())
               for key, factor in factors.items())


#: COD of phenol as printed (it is in no scene), and half a last digit of what Table 1 prints.
COD, HALF_DIGIT = 2.38, 0.005
#: The unit of its diffusivities (1e-4 m2/d, in um2/h), and atomic weights.
DIFFUSIVITY = 1e8 / 24
WEIGHT = {"C": 12.011, "H": 1.008, "O": 15.999, "N": 14.007}


@claim("C28", "Table 1", "F = COD - Y d_c; diffusivity in the aggregate 80 % of that in water", about=CLOSED)
def table_1() -> Finding:
    """F from Table 1's own entries and from chemical formulas; ratios of diffusivities. E1 reports the effect of the
    error of F on base."""
    scene = load_packaged(*BASE)
    law, paper = scene.kinetics, scene.kinetics.acceptor_to_donor_ratio
    y, d_c = law.yield_coefficient, law.decay_oxygen_demand
    value, from_formulas = COD - y * d_c, oxygen_demand(7, C=6, H=6, O=1) - y * oxygen_demand(5, C=5, H=7, O=2, N=1)
    printed_values = [(printed_value, HALF_DIGIT) for printed_value in (COD, y, d_c)]
    checks = [printed("COD - Y d_c from the printed values (mg/mg)", f"{paper}", value, rests_on=ARITHMETIC,
                      within=sensitivity.in_closed_form(lambda cod, y, d_c: cod - y * d_c, *printed_values))]
    for name in SUBSTRATES:
        substrate = getattr(scene.substrates, name)
        diffusivities = (substrate.diffusivity_in_aggregate, substrate.diffusivity)
        printed_values = [(diffusivity / DIFFUSIVITY, HALF_DIGIT) for diffusivity in diffusivities]
        checks.append(printed(f"{name}: diffusivity, aggregate over water (%)", "80",
                              100 * substrate.diffusivity_in_aggregate / substrate.diffusivity, rests_on=ARITHMETIC,
                              within=sensitivity.in_closed_form(lambda inner, outer: 100 * inner / outer,
                                                                *printed_values)))
    near_d_c = d_c - HALF_DIGIT
    nearest = COD - y * near_d_c
    rounding = (f"COD {COD:.3f} and Y {y:.3f} as printed and d_c {near_d_c:.3f}, which rounds to the printed one, give "
                f"{nearest:.4f}")
    low, high = interval(f"{paper}")
    note = (f"Table 1's entries give {value:.4f} [E1]; with C6H6O + 7 O2 and C5H7O2N + 5 O2 for COD and d_c it is "
            f"{from_formulas:.4f}.")
    return Finding(tuple(checks), reason=f"Table 1's own COD, Y and d_c give {value:.4f} [E1]",
                   rounding=rounding if low <= nearest <= high else "", note=note)


def oxygen_demand(molecules: int, **atoms: int) -> float:
    """Mass of O2 (mg) that oxidises 1 mg of a compound; ``molecules``: molecules of O2 for one molecule of it."""
    return molecules * 2 * WEIGHT["O"] / sum(count * WEIGHT[atom] for atom, count in atoms.items())


SECONDS = 3600.0
#: Concentration that stands for saturation, mg/L.
ENDLESS = 1e12


@claim("C09", "4", "doubling time about 3 h; decay half-time about 5.8 d", date="2026-11-30 10:45")
def doubling() -> Finding:
    """Doubling time at saturation, of a seed at the supply, and of base's aggregate, mean over 19.2 h; ln 2 / b."""
    scene, row = load_packaged(*BASE), at(BASE, PLOTTED)
    supply, half = scene.substrates.acceptor.supply, log(2) / scene.kinetics.decay_coefficient / 24
    mean = row["time_h"] * log(2) / log(row["aggregate_area_um2"] / at(BASE, 0.0)["aggregate_area_um2"])
    fastest, endless = (_doubling_time(scene, value) for value in (supply, ENDLESS))
    checks = (printed("doubling time at saturation (h)", "~3", endless, rests_on=ARITHMETIC),
              between("doubling time of base's aggregate, mean to 19.2 h (h)", "3 in base", mean, *interval("~3"),
                      DIGITS, input="doubling"),
              between("doubling time at the supply of 10 K_s (h)", "3 at the supply", fastest, *interval("~3"), DIGITS,
                      rests_on=ARITHMETIC, input="doubling_at_supply"),
              printed("decay half-time (d)", "~5.8", half, rests_on=ARITHMETIC,
                      within=sensitivity.in_closed_form(lambda b: log(2) / b, (0.12, HALF_DIGIT))))
    reason = (f"the sentence gives the largest rate: {endless:.2f} h is the doubling time at saturation. At the supply "
              f"of 10 K_s, which nothing in base exceeds, it is {fastest:.2f} h, and base doubles every {mean:.2f} h")
    return Finding(checks, reason=reason)


def _doubling_time(scene, concentration: float) -> float:
    """ln 2 / (F3 / X_A), h, at one concentration of both substrates (mg/L)."""
    return log(2) / float(rate_law(scene.substrates, scene.kinetics).growth_rate(concentration, concentration))


@claim("C18", "1", "within a 600 um pore: flow << 1 s, advection a few seconds, diffusion of the order of minutes, "
       "growth hours")
def time_scales() -> Finding:
    """W^2 / nu, L / u_ave, L^2 / D of both substrates, and the doubling time at the supply. Only u_ave is from a
    solution, and the smallest ratio does not contain it."""
    scene, speed = load_packaged(*BASE), at(BASE, 0.0)["mean_velocity_m_per_d"]
    length, width = scene.pore.length, scene.pore.width
    viscous, advection = SECONDS * width**2 / scene.flow.kinematic_viscosity, SECONDS * length / speed * 24e-6
    diffusion = [60 * length**2 / diffusivity for diffusivity in pair("diffusivity", scene.substrates)]
    growth = _doubling_time(scene, scene.substrates.acceptor.supply)
    separation = min(advection / viscous, growth * 60 / max(diffusion))
    tenfold = "of the order: one to ten of the unit"
    checks = (at_most("flow, W^2 / nu (s)", "<< 1", viscous, 0.1, "much less: a tenth",
                      rests_on=ARITHMETIC),
              between("advection, L / u_ave at t = 0 (s)", "a few", advection, 2, 10, "a few: two to ten"),
              *(between(f"diffusion of the {name}, L^2 / D (min)", "order of minutes", value, 1, 10, tenfold,
                        rests_on=ARITHMETIC) for name, value in zip(SUBSTRATES, diffusion)),
              between("growth, doubling time at the supply (h)", "hours", growth, 1, 10, tenfold,
                      rests_on=ARITHMETIC),
              at_least("substrates over flow, growth over substrates (times)", "sequential", separation, 10,
                       "an order of magnitude, of both ratios", rests_on=ARITHMETIC))
    slow = advection * speed / at(BASE, PLOTTED)["mean_velocity_m_per_d"]
    reason = (f"advection over 600 um takes {advection:.0f} s at the paper's own 2.9 m/d, {advection / 1.5:.0f} s on "
              f"the axis of the pore, and {slow:.0f} s at the velocity of 19.2 h; over 100 um it takes "
              f"{advection / 6:.0f} s. The order of the scales, on which the sequential coupling rests, holds")
    return Finding(checks, reason=reason)


TIMES = (0.0, PLOTTED, END)
#: Halved quantities of base in the paper's scheme: the level, and the accepted change of the velocity in percent.
HALVED = {"time step": (Level(step=0.5), 0.5), "mesh size": (Level(size=0.5), 1.0)}
LEVELS = (DEFAULT, *(level for level, _ in HALVED.values()))


def velocities(level: Level) -> list[float]:
    """Mean velocities (m/d) of base at TIMES."""
    with at_level(level), np.errstate(all="raise", under="ignore"):
        return [at(BASE, time)["mean_velocity_m_per_d"] for time in TIMES]


def independence() -> tuple[PaperCheck, ...]:
    """Halving the time step moves the velocity by less than 0.5 %, halving the mesh size by less than 1 %."""
    velocity = dict(zip(LEVELS, map_in_parallel(velocities, LEVELS)))
    return tuple(at_most(f"halving the {size} moves the velocity at {time:g} h (%)", f"< {bound:g}",
                         100 * abs(new / old - 1), bound, "set beforehand")
                 for size, (level, bound) in HALVED.items()
                 for time, old, new in zip(TIMES, velocity[DEFAULT], velocity[level]))
