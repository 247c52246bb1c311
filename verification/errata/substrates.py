"""E1, E3, E4, E9, E14, E18, E24, E27: consumption, supply and balances; E19, E21-E23: checks of Table 1 and of the text
without a run."""

from dataclasses import replace
from math import atan, cbrt, degrees, exp, log

import numpy as np
from scipy.optimize import brentq

from repro.model.kinetics import rate_law
from verification.claims.base_run import upstream_means
from verification.claims.levels import CONVERGED, Level, at_level
from verification.claims.runs import BASE, PLATES, at, grown, grown_on_new_mesh, load_packaged, series, solved_pore
from verification.claims.scheme import PAPER_CORRECTION, REFINEMENTS, bookkeeping, exceeding, printed_scheme
from verification.errata import (
    STATE_HEAD,
    Numbers,
    consumed_ratio,
    erratum,
    percent,
    small,
    state,
    state_row,
)
from verification.evidence.writing import table
from verification.switches import CHOICES, PLOTTED, changed

SHORT_F, MEAN_INLET = (CHOICES[name].run for name in ("exact F", "mean inlet"))
NO_D_C = changed("kinetics.decay_oxygen_demand=1.0")
COD = 2.38  # of phenol, Table 1; it enters through F alone


@erratum(
    "E1", "F is printed as 1.52 but defined as 1.5138",
    printed="Table 1 gives F = COD - Y d_c and the value 1.52 mg/mg.",
    reading="The table's own COD, Y and d_c give less. We keep 1.52, the paper's number.",
    consequence="""
        COD - Y d_c = {value}. The table has its effect on base at 19.2 h, in the converged solution, which excludes
        differences of meshes. The ratio of consumed acceptor to donor would be {ratio} instead of {ours}.

        {table}""")
def ratio_of_substrates() -> Numbers:
    """Base with F as defined."""
    scene = load_packaged(*BASE).kinetics
    with at_level(Level(CONVERGED)):
        rows = [state_row("F = 1.52 (ours)", BASE), state_row("F = 1.5138", SHORT_F)]
        ratios = [f"{consumed_ratio(*state(run)[1:]):.3f}" for run in (SHORT_F, BASE)]
    return {"value": f"{COD - scene.yield_coefficient * scene.decay_oxygen_demand:.4f}",
            "ratio": ratios[0], "ours": ratios[1], "table": table(STATE_HEAD, rows)}


@erratum(
    "E3", "the oxygen demand of decay",
    printed='(7) adds "d_f d_b" to k F m_D; neither symbol is defined anywhere.',
    reading="""d_c f_d b, of Table 1: mg of oxygen per mg of biomass, times the share that degrades, times the
        rate of decay. Its unit is 1/d, like that of k F, and (9)-(10) require it: X_A loses b and leaves (1 - f_d) b
        inert, so biomass with the oxygen demand d_c f_d b disappears. With this term and F = COD - Y d_c, oxygen
        demand is conserved at every point.""",
    consequence="""
        The term is {share} % of the acceptor's uptake in base at 19.2 h. The oxygen that each reading uses beyond
        the oxygen demands of donor and biomass, as a share of the uptake:

        {table}

        Changes of base at 19.2 h with f_d b in place of d_c f_d b: velocity {velocity}, acceptor effluent
        {acceptor}, donor effluent {donor}.""")
def decay_demand() -> Numbers:
    """Size of the term, electron balance of the readings, and base with d_c left out."""
    scene = load_packaged(*BASE)
    law = scene.kinetics
    defined = replace(law, acceptor_to_donor_ratio=COD - law.yield_coefficient * law.decay_oxygen_demand)
    readings = {"F = 1.52, d_c f_d b (ours)": law, "F = 1.5138, d_c f_d b": defined,
                "F = 1.5138, f_d b": replace(defined, decay_oxygen_demand=1.0),
                "F = 1.5138, no term": replace(defined, decay_oxygen_demand=0.0)}
    rows = [[name, percent(1 + electron_defect(reading_law))] for name, reading_law in readings.items()]
    share = 1 - acceptor_and_donor_uptake(replace(law, decay_oxygen_demand=0.0))[0] / acceptor_and_donor_uptake(law)[0]
    velocity, acceptor, donor = (percent(a / b) for a, b in zip(state(NO_D_C), state(BASE)))
    return {"share": f"{100 * share:.1f}", "velocity": velocity, "acceptor": acceptor, "donor": donor,
            "table": table(["reading", "oxygen used in excess"], rows)}


def plotted_biomass():
    """(weight, C_A, C_D) at the nodes of base at 19.2 h; weight: X_A times the biomass area around the node."""
    pore, solved = solved_pore(PLATES, PLOTTED)
    nodes, state = pore.space.reaction.cells[:, 0], solved.concentrations
    return pore.active[:, 0], state.acceptor[nodes], state.donor[nodes]


def acceptor_and_donor_uptake(law) -> np.ndarray:
    """(2,) oxygen and donor, over the aggregate."""
    weight, *both = plotted_biomass()
    return np.array(rate_law(load_packaged(*BASE).substrates, law).uptake(*both)) @ weight


def electron_defect(law) -> float:
    """Defect of the oxygen demand under a reading of (7): (oxygen taken up + oxygen demand of new biomass - oxygen
    demand of the donor taken up) / oxygen taken up."""
    scene = load_packaged(*BASE)
    weight, acceptor, donor = plotted_biomass()
    present = rate_law(scene.substrates, scene.kinetics)
    rates = present.growth_rate(acceptor, donor) + present.inert_rate(acceptor, donor)
    oxygen, spent = acceptor_and_donor_uptake(law)
    return 1 + (scene.kinetics.decay_oxygen_demand * weight @ rates - COD * spent) / oxygen


@erratum(
    "E4", "u_ave in the inlet condition",
    printed="(11) supplies u_ave C_supply and takes u_ave C - D dC/dx, uniform over the inlet.",
    reading="""u_x(y) in place of u_ave, since the entering flow is parabolic (3). If the concentration does not vary
        across the inlet, both conditions are equal, and (26) follows from either. Otherwise only u_x(y) supplies as
        much as (7)-(8) carry away. `replace(PAPER, inlet="mean")` is the printed form.""",
    consequence="""
        Base; the balance defect is (supplied - out - consumed) / supplied, with the flow-weighted effluent:

        {table}""")
def inlet_condition() -> Numbers:
    """Base with both forms of (11)."""
    columns, rows = [f"{end}_{name}_mg_per_L" for end in ("inlet", "effluent") for name in ("acceptor", "donor")], []
    for time in (0.0, PLOTTED):
        for name, run in (("u_x(y), ours", BASE), ("u_ave", MEAN_INLET)):
            row = at(run, time)
            defect = max((row["acceptor_balance"], row["donor_balance"]), key=abs)
            rows.append([f"{name}, {time:g} h", *(f"{row[key]:.4f}" for key in columns), small(defect)])
    head = ["", "inlet acceptor", "inlet donor", "effluent acceptor", "effluent donor", "balance defect"]
    return {"table": table(head, rows)}


@erratum(
    "E9", "it is the acceptor that has 7 K_s at the meshed inlet",
    printed="""Section 4: "the electron donor concentration at the inlet of the meshed domain is ~7 K_s", 70 %
        of the influent's, 60 um away from the aggregate.""",
    reading="""The sentence is about the acceptor. The donor has less than half its diffusivity and is consumed
        at two thirds of its rate: its profile (26) is steeper and shorter, so it cannot be that low at this
        distance. The rules of 3.1 do not allow the distance either (65 um at least; 75 um in a domain of
        210 um around an aggregate of 60 um).""",
    consequence="""
        Base at 19.4 h before the expansion (E12), flow-weighted over the section, upstream of the aggregate (our
        meshed inlet is {distance} um from it):

        {table}""")
def meshed_inlet() -> Numbers:
    """Both substrates at the distances in question."""
    pore, solved = grown_on_new_mesh(BASE, PLOTTED)
    rows = [[f"{d} um", *map("{:.2f}".format, upstream_means(pore, solved, float(d)))] for d in (60, 65, 75)]
    distance = pore.boundary.upstream - pore.mesh.ends[0]
    return {"table": table(["distance", "acceptor", "donor"], rows), "distance": f"{distance:.0f}"}


@erratum(
    "E14", "the printed effluents contradict the printed F",
    printed="Effluents of 4.19 and 6.13 K_s from 10 K_s each.",
    reading="""The uptake of 1 mg of donor consumes at least F mg of acceptor, and decay consumes more. According to
        section 4 the effluents must be 1.6 % higher to balance. This is the same contradiction: a numerical error of
        the paper's own effluents. No reading of the model removes it, and the scheme as printed does not make it:
        substrate is lost (E24), but the ratio of consumed acceptor to donor stays above F.""",
    consequence="""
        Acceptor over donor consumed: {printed} from the printed effluents, less than F = 1.52, which is
        impossible if both K_s are equal; {corrected} with the paper's 1.6 % on both, within 1 % of {ours} (F and
        the decay), in base at 19.4 h before the expansion. An acceptor effluent of 4.19 corresponds to a donor
        effluent of {donor}, {apart} against the printed one. The origin of the contradiction remains unknown.""")
def printed_effluents() -> Numbers:
    """Stoichiometry of the printed numbers and of ours."""
    ratio = consumed_ratio(*(flux.effluent for flux in grown(BASE, PLOTTED)[1].fluxes))
    donor = 10 - (10 - 4.19) / ratio
    corrected = consumed_ratio(PAPER_CORRECTION * 4.19, PAPER_CORRECTION * 6.13)
    return {"printed": f"{consumed_ratio(4.19, 6.13):.3f}", "corrected": f"{corrected:.3f}",
            "ours": f"{ratio:.3f}", "donor": f"{donor:.2f}", "apart": percent(donor / 6.13, 1)}


@erratum(
    "E18", "the mass balance of section 4",
    printed="""dM_C = U_ave(t_0) (C_supply - C_effluent(t_0 + dt)) dt, compared with dM_X = X_m (Omega_B(t_0 +
        dt) - Omega_B(t_0)).""",
    reading="""dM_C lacks the factor W: it is a mass per area, dM_X a mass per length. It also uses the velocity at
        the start and the effluent at the end for the whole step.""",
    consequence="""
        Times W = {width} um, dM_C of base exceeds what F1 and F2 consume, integrated over the step:

        {table}

        Our own ledger closes to round-off, so these are errors of the formula. The paper's 1.6 % is another one. On a
        coarse mesh the scheme as printed loses as much substrate (E24), so effluents must be raised to balance. The
        paper raises them "throughout the whole numerical simulation". The 1.6 % cannot hold throughout: until {until} h
        an effluent raised by it exceeds the supply (the donor's for the longer time).""")
def balance_formula() -> Numbers:
    """Ratio of the paper's dM_C to the integrals of F1 and F2, in some steps of base."""
    book, columns = bookkeeping(BASE), series(*BASE)
    after = np.array([columns[f"effluent_{name}_mg_per_L"][1:] for name in ("acceptor", "donor")])
    kinds = {"before the expansion": book.effluent, "after it": after}
    ratios = np.vstack([book.volume * (book.supply - effluent) / book.consumed for effluent in kinds.values()])
    rows = []
    for time in (0.2, 5.0, 10.0, 15.0, 19.4):
        step = np.argmin(np.abs(book.end - time))
        rows.append([f"{time:g} h", *(percent(ratio, 1) for ratio in ratios[:, step])])
    head = ["step ending at", *(f"{name}, effluent {kind}" for kind in kinds for name in ("acceptor", "donor"))]
    width = load_packaged(*BASE).pore.width
    return {"table": table(head, rows), "width": f"{width:g}", "until": f"{exceeding(book):.1f}"}


@erratum(
    "E19", "smaller points",
    consequence="""
        Contradictions within Table 1 and the text:

        {table}""",
    quick=True)
def smaller_points() -> Numbers:
    """Numbers of Table 1 and of the text that can be checked against each other."""
    scene = load_packaged("base")
    crossing = scene.pore.length / (2.9 / 24e-6) * 3600
    linear = cbrt(36.0) - 1
    rows = [
        ["Table 1", "density of water, 998 mg cm-3",
         f"right, {998 / 1000:.3f} g cm-3; with the pressure as a head, it does not occur in (1)-(6)"],
        ["2.1", "the head is once called theta", "phi; theta is the expansion"],
        ["2.3.1, Table 1", "mu_L is a Lame coefficient",
         "the shear modulus; the shape does not depend on it without tractions"],
        ["2.3.2", "(20) has body forces f_0, (22) and (27) have none", "neglected, as the text says"],
        ["(18)", "alpha is the volumetric coefficient, yet 1 + alpha (T - T_0) is cubed, as with a linear one",
         "only an analogy for (19): theta = 36 would be "
         f"alpha (T - T_0) = {linear:.2f} with a linear coefficient, {36 - 1} with a volumetric one"],
        ["2.3.3, Table 1", "minimum angle 17 deg, 16.7 deg, tangent 0.3",
         f"arctan 0.3 = {degrees(atan(0.3)):.2f} deg; we take 16.7"],
        ["1", "advection through a 600 um pore takes a few seconds",
         f"{crossing:.0f} s at 2.9 m/d, {crossing * 2.9 / 1.5:.0f} s at 1.5 m/d"],
        ["4", "about 60 % of the acceptor is consumed", f"{100 - 10 * 4.19:.1f} % by the printed effluent of 4.19 K_s"],
        ["Table 1, 4", "pore width typically 100 um; 50 um in section 4", "base takes 50 um, wide 100 um"],
    ]
    return {"table": table(["where", "printed", "our reading, consequence"], rows)}


#: Printed diffusivity in water, cm2/d; molar volume at the boiling point by LeBas, cm3/mol, as the method of Hayduk &
#: Laudie takes it.
SUBSTRATES = {"oxygen": (2.32, 25.6), "phenol": (1.01, 103.4)}
ZERO_C = 273.15


def viscosity(celsius: float) -> float:
    """Of water, cP: Vogel's law, 2.414e-2 10^(247.8 / (T - 140 K)), within 2.5 % from 0 to 370 C."""
    return 2.414e-2 * 10 ** (247.8 / (celsius + ZERO_C - 140))


def hayduk_laudie(celsius: float, volume: float) -> float:
    """Diffusivity in water, cm2/d: 13.26e-5 mu^-1.14 V^-0.589 cm2/s (1974), mu in cP."""
    return 86400 * 13.26e-5 * viscosity(celsius) ** -1.14 * volume**-0.589


def temperature_of(diffusivity: float, volume: float) -> float:
    """The temperature (C) at which Hayduk & Laudie give a diffusivity (cm2/d)."""
    return brentq(lambda celsius: hayduk_laudie(celsius, volume) - diffusivity, 0.0, 100.0)


@erratum(
    "E21", "the diffusivities of Table 1 are not those of 20 C",
    printed="""Temperature 20 C; D of oxygen 2.32 and of phenol 1.01 cm2/d in water, "estimated using the method of
        Hayduk and Laudie [1974]"; the viscosity of water is that of 20 C.""",
    reading="We keep the printed values.",
    consequence="""
        The method at 20 C, and the temperature at which it gives the printed values, with the viscosity of water by
        Vogel's law:

        {table}

        Both values belong to the same, warmer water. Their rounding changes the effluents of base by less than
        a last digit (`verification/sensitivity`).""",
    quick=True)
def diffusivities() -> Numbers:
    """Both diffusivities by the method that the paper names."""
    rows = [[name, printed, f"{hayduk_laudie(20.0, volume):.2f}", f"{temperature_of(printed, volume):.0f} C"]
            for name, (printed, volume) in SUBSTRATES.items()]
    return {"table": table(["", "printed, cm2/d", "at 20 C, cm2/d", "printed value is that of"], rows)}


def oxygen_saturation(celsius: float) -> float:
    """Of water under air of 1 atm, mg/L (Benson & Krause 1984, without salt)."""
    T = celsius + ZERO_C
    return exp(-139.34411 + 1.575701e5 / T - 6.642308e7 / T**2 + 1.243800e10 / T**3 - 8.621949e11 / T**4)


@erratum(
    "E22", "more oxygen is supplied than air dissolves",
    printed="Supply of 10 K_s with K_s = 1.0 mg/L of oxygen at 20 C.",
    reading="10 mg/L, as printed: the medium may be enriched.",
    consequence="""
        Water under air of 1 atm holds {saturation} mg/L at 20 C and 10 mg/L at {temperature} C or less.""",
    quick=True)
def oxygen_supplied() -> Numbers:
    """Saturation at 20 C, and the temperature of 10 mg/L."""
    temperature = brentq(lambda celsius: oxygen_saturation(celsius) - 10, 0.0, 20.0)
    return {"saturation": f"{oxygen_saturation(20.0):.2f}", "temperature": f"{temperature:.1f}"}


@erratum(
    "E23", "the doubling time of 3 hours is that at saturation",
    printed='"The doubling time is ~3 hours" (4).',
    reading="The printed time is that at C >> K_s. Base does not reach such concentrations (C09, C33).",
    consequence="""
        ln 2 over the net growth rate k Y m_A m_D - b m_A: {saturated} h at saturation, {supplied} h at 10 K_s of both,
        the largest concentrations in base.""",
    quick=True)
def doubling_time() -> Numbers:
    """At saturation and at the supply."""
    scene = load_packaged("base")
    law = rate_law(scene.substrates, scene.kinetics)
    rates = [float(law.growth_rate(value, value)) for value in (1e12, 10.0)]
    return dict(zip(("saturated", "supplied"), (f"{log(2) / rate:.2f}" for rate in rates)))


@erratum(
    "E24", "what carries the substrates",
    printed="""(7) and (8) are advected by u, the velocity of the stabilised linear triangles (3.2).""",
    reading="""w = u - tau grad p, whose discrete divergence vanishes, so that no substrate is lost. Four choices of the
        preset `paper` are not the printed ones: this one, u_x(y) in (11) (E4), quasi-steady substrates between updates,
        and a remesh that conserves biomass (E8). The preset `as_printed` has all four as printed.""",
    consequence="""
        The discrete u conserves water only on average, so substrate is lost near the aggregate. The table has base at
        19.2 h by `as_printed` with one change, u_x(y) in (11): u_ave makes an error of its own (E4). The meshes have
        several sizes. Lost: supplied - out - consumed, in percent of the effluent, the factor by which effluents must
        be raised to balance. Consumed ratio: acceptor over donor by the effluents (printed: 1.501).

        {table}

        The loss has the sign of the paper's correction, on both substrates, and is nearest to its 1.6 % with {nodes}
        nodes. But there velocity and effluents are {nearest}, far from the printed 1.5 m/d, 4.19 and 6.13, and no mesh
        of the table has the printed ratio: the least one is {least}, above F = 1.52. So this loss does not explain the
        printed effluents (E14). The paper prints no number of nodes. `as_printed` itself, with u_ave, loses {mean} with
        the element size of the last line ({mean_nodes} nodes).""")
def carrier() -> Numbers:
    """The scheme as printed on several meshes."""
    meshes = [printed_scheme(refinement) for refinement in REFINEMENTS]
    first = [printed_scheme(refinement, 0.0) for refinement in REFINEMENTS]
    rows = [[f"{mesh.nodes} ({start.nodes} at t = 0)", f"{mesh.velocity:.3f}", *map("{:.3f}".format, mesh.effluent),
             *(f"{lost:.2f} %" for lost in mesh.lost), f"{consumed_ratio(*mesh.effluent):.3f}"]
            for mesh, start in zip(meshes, first)]
    nearest = min(meshes, key=lambda mesh: abs(float(np.max(mesh.lost)) - 1.6))
    mean = printed_scheme(REFINEMENTS[-1], PLOTTED, "mean")
    return {"table": table(["nodes", *STATE_HEAD[1:], "acceptor lost", "donor lost", "consumed ratio"], rows),
            "nodes": str(nearest.nodes),
            "nearest": "{:.3f} m/d, {:.3f} and {:.3f}".format(nearest.velocity, *nearest.effluent),
            "least": f"{min(consumed_ratio(*mesh.effluent) for mesh in meshes):.3f}",
            "mean": " and ".join(f"{lost:.2f} %" for lost in mean.lost), "mean_nodes": str(mean.nodes)}


@erratum(
    "E27", "what the effluent is",
    printed="""C_effluent, "the effluent electron acceptor and electron donor concentrations" (4); no formula.""",
    reading="""The flux of substrate through the outlet over the discharge, which balances the supply.""",
    consequence="""
        Base at 19.2 h in the converged solution: {table}""")
def effluent() -> Numbers:
    """The flux over the discharge, and the mean of the concentration over the outlet."""
    with at_level(Level(CONVERGED, 1.0)):
        pore, solved = solved_pore(BASE, PLOTTED)
    nodes = pore.space.outlet.nodes
    y = pore.space.points[nodes, 1] if hasattr(pore.space, "points") else pore.mesh.points[nodes, 1]
    order = np.argsort(y)
    means = [np.trapezoid(field[nodes][order], y[order]) / np.ptp(y)
             for field in (solved.concentrations.acceptor, solved.concentrations.donor)]
    rows = [["flux over discharge (ours)", *(f"{flux.effluent:.4f}" for flux in solved.fluxes)],
            ["mean over the outlet", *(f"{mean:.4f}" for mean in means)]]
    return {"table": "\n\n" + table(["", "acceptor", "donor"], rows)}
