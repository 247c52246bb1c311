"""Wrong changes to the midpoint rule and to runs on curved triangles that cases of this stage must catch."""

from verification.mutants import Mutant

COUPLING = "repro/curved/coupling.py"
CURVED = (
    Mutant("curved-rates-of-the-start", COUPLING,
           says="A whole step is made with the rates of its start: Euler's rule.",
           old="after = grown(now, half.rates, duration)",
           new="after = grown(now, rates_of(scene, solved.concentrations), duration)"),
    Mutant("midpoint-rates-of-the-start", "repro/march/midpoint.py",
           says="With linear elements a whole step is made with the rates of its start: Euler's rule.",
           old="grown = _grown(now, rates, duration)",
           new="grown = _grown(now, first, duration)"),
    Mutant("curved-mass-lost", COUPLING,
           says="A remesh loses one percent of the active biomass.",
           old="active[nodes] = 1 - inert[nodes]",
           new="active[nodes] = 0.99 - inert[nodes]"),
    Mutant("curved-half-of-the-half", COUPLING,
           says="Biomass grows for half of the step only.",
           old="after = grown(now, half.rates, duration)",
           new="after = grown(now, half.rates, duration / 2)"),
    Mutant("newton-never-reused", "repro/fem/newton.py",
           says="Every step of Newton's method factorises its derivative anew, whatever the scene says.",
           old="not self.reused or defect > ENOUGH * last",
           new="defect >= 0"),
    Mutant("cubic-shown-less", "repro/curved/fields.py",
           says="The biomass sees one percent less of cubic concentrations than there is.",
           old="DOWN, UP = cubic_functions(elements.NODES)",
           new="DOWN, UP = 0.99 * cubic_functions(elements.NODES)"),
)
