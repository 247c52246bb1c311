"""E19: what can be checked of Table 1 and of the text without computing anything large."""

from __future__ import annotations

from math import atan, cbrt, degrees

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
