"""E19, E21-E23: what can be checked of Table 1 and of the text without computing anything large."""

from __future__ import annotations

from math import atan, cbrt, degrees, exp, log, log10

from repro.model import kinetics
from verification.claims.runs import scene
from verification.errata import erratum, table


@erratum(
    "E19", "smaller points",
    consequence="""
        What Table 1 and the text say against each other:

        {table}""",
    quick=True)
def smaller_points() -> dict[str, str]:
    """Numbers of Table 1 and of the text that can be checked against each other."""
    said = scene("base")
    crossing = said.pore.length / (2.9 / 24e-6) * 3600
    linear = cbrt(36.0) - 1
    rows = [
        ["Table 1", "density of water, 998 mg cm-3",
         f"right, {998 / 1000:.3f} g cm-3; with the pressure as a head, (1)-(6) do not need it, and it takes no part"],
        ["2.1", "the head is once called theta", "phi; theta is the expansion"],
        ["2.3.1, Table 1", "mu_L is a Lame coefficient", "the shear modulus; without tractions it moves nothing"],
        ["2.3.2", "(20) has body forces f_0, (22) and (27) have none", "neglected, as the text says"],
        ["(18)", "alpha is the volumetric coefficient, yet 1 + alpha (T - T_0) is cubed, as with a linear one",
         "an analogy for (19) and no more: theta = 36 would be "
         f"alpha (T - T_0) = {linear:.2f} with a linear coefficient, {36 - 1} with a volumetric one"],
        ["2.3.3, Table 1", "minimum angle 17 deg, 16.7 deg, tangent 0.3",
         f"arctan 0.3 = {degrees(atan(0.3)):.2f} deg; we take 16.7"],
        ["1", "advection through a 600 um pore takes a few seconds",
         f"{crossing:.0f} s at 2.9 m/d, {crossing * 2.9 / 1.5:.0f} s at 1.5 m/d"],
        ["4", "about 60 % of the acceptor is consumed", f"{100 - 10 * 4.19:.1f} % by the printed effluent of 4.19 K_s"],
        ["Table 1, 4", "pore width typically 100 um; 50 um in section 4", "base takes 50 um, wide 100 um"],
    ]
    return {"table": table(["where", "printed", "our reading, consequence"], rows)}


#: Molar volumes at the boiling point, cm3/mol, with which the method of Hayduk & Laudie is used (LeBas).
MOLAR_VOLUME = {"oxygen": 25.6, "phenol": 103.4}
PRINTED = {"oxygen": 2.32, "phenol": 1.01}
ZERO_C = 273.15


def viscosity(celsius: float) -> float:
    """Of water, cP: Vogel's law, 2.414e-2 10^(247.8 / (T - 140 K)), within 2.5 % from 0 to 370 C."""
    return 2.414e-2 * 10 ** (247.8 / (celsius + ZERO_C - 140))


def hayduk_laudie(celsius: float, volume: float) -> float:
    """Diffusivity in water, cm2/d: 13.26e-5 mu^-1.14 V^-0.589 cm2/s (1974), mu in cP."""
    return 86400 * 13.26e-5 * viscosity(celsius) ** -1.14 * volume**-0.589


def temperature_of(diffusivity: float, volume: float) -> float:
    """The temperature (C) at which Hayduk & Laudie give a diffusivity (cm2/d)."""
    wanted = (86400 * 13.26e-5 * volume**-0.589 / diffusivity) ** (1 / 1.14)
    return 140 + 247.8 / log10(wanted / 2.414e-2) - ZERO_C


@erratum(
    "E21", "the diffusivities of Table 1 are not those of 20 C",
    printed="""Temperature 20 C; D of oxygen 2.32 and of phenol 1.01 cm2/d in water, "estimated using the method of
        Hayduk and Laudie [1974]"; the viscosity of water is that of 20 C.""",
    reading="We keep the printed values.",
    consequence="""
        The method at 20 C, and the temperature at which it gives the printed values, water's viscosity by Vogel's
        law:

        {table}

        Both are those of one and the same warmer water. What the printed digits leave open of them moves the
        effluents of base by less than their last digits (`verification/sensitivity`).""",
    quick=True)
def diffusivities() -> dict[str, str]:
    """Both diffusivities by the method that the paper names."""
    rows = [[name, PRINTED[name], f"{hayduk_laudie(20.0, volume):.2f}",
             f"{temperature_of(PRINTED[name], volume):.0f} C"] for name, volume in MOLAR_VOLUME.items()]
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
def oxygen_supplied() -> dict[str, str]:
    """Saturation at 20 C, and the temperature of 10 mg/L by bisection."""
    low, high = 0.0, 20.0
    while high - low > 1e-6:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if oxygen_saturation(middle) > 10 else (low, middle)
    return {"saturation": f"{oxygen_saturation(20.0):.2f}", "temperature": f"{low:.1f}"}


@erratum(
    "E23", "the doubling time of 3 hours is that at saturation",
    printed='"The doubling time is ~3 hours" (4).',
    reading="That of C >> K_s, which base does not have (C09, C33).",
    consequence="""
        ln 2 over the net growth rate k Y m_A m_D - b m_A: {saturated} h at saturation, {supplied} h at 10 K_s of both,
        the most that anything in base sees.""",
    quick=True)
def doubling_time() -> dict[str, str]:
    """At saturation and at the supply."""
    said = scene("base")
    rates = [float(kinetics.growth_rate(value, value, said.substrates, said.kinetics)) for value in (1e12, 10.0)]
    return dict(zip(("saturated", "supplied"), (f"{log(2) / rate:.2f}" for rate in rates)))
