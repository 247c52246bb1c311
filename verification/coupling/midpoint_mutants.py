"""Wrong changes to the midpoint rule, and to what presets choose, that cases of this stage must catch."""

from verification.mutants import Mutant

MIDPOINT_RULE = "repro/march/midpoint.py"
MIDPOINT = (
    Mutant("midpoint-rates-of-the-start", MIDPOINT_RULE,
           says="A whole step is made with the rates of its start: Euler's rule.",
           old="after = _matched(now, grown(now, half.rates, duration), half.made)",
           new="after = grown(now, first, duration)"),
    Mutant("curved-rates-of-the-start", MIDPOINT_RULE,
           says="The shape half way is that of the start.",
           old="ahead = replace(grown(now, first, duration / 2),",
           new="ahead = replace(grown(now, first, 0.0),"),
    Mutant("curved-half-of-the-half", MIDPOINT_RULE,
           says="Biomass grows for half of the step only.",
           old="after = _matched(now, grown(now, half.rates, duration), half.made)",
           new="after = grown(now, half.rates, duration / 2)"),
    Mutant("newton-never-reused", "repro/fem/newton.py",
           says="Every step of Newton's method factorises its derivative anew, whatever the scene says.",
           old="not self.reused or defect > ENOUGH * last",
           new="defect >= 0"),
    Mutant("cubic-shown-less", "repro/model/biomass.py",
           says="The biomass sees one percent less of cubic concentrations than there is.",
           old="acceptor, donor = both[:, pieces.cells] @ pieces.values.T",
           new="acceptor, donor = (0.99 if space.order == 3 else 1.0) * both[:, pieces.cells] @ pieces.values.T"),
)
