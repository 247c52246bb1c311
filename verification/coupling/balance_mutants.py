"""Wrong changes to what is balanced in a step that cases of this stage must catch."""

from verification.mutants import Mutant

MIDPOINT_RULE = "repro/march/midpoint.py"
BALANCES = (
    Mutant("biomass-of-the-start-takes-up", MIDPOINT_RULE,
           says="Half way the biomass of the step's start takes up substrates, not the mean of the step.",
           old="found = pore.solve(scene, there, duration)",
           new="found = pore.solve(scene, there)"),
    Mutant("remesh-half-way-unmatched", MIDPOINT_RULE,
           says="After a remesh half way what is made is not what was taken up for it there.",
           old="after = _matched(now, grown(now, half.rates, duration), half.made)",
           new="after = grown(now, half.rates, duration)"),
    Mutant("masses-of-the-start-kept", "repro/model/contact.py",
           says="The new shape has the masses of the pore from which its search starts: what has grown is lost.",
           old="found = replace(grown, space=start.space,",
           new="found = replace(grown, active=start.active, inert=start.inert, space=start.space,"),
    Mutant("flows-of-the-start", MIDPOINT_RULE,
           says="A step's ledger has the flows of its start, not those half way.",
           old="_flows(half.solved, duration)",
           new="_flows(solved, duration)"),
)
