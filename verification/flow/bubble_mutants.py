"""Wrong changes to the condensed bubble that cases of this stage must catch."""

from verification.mutants import Mutant

BUBBLE = (
    Mutant("bubble-of-water", "repro/model/flow.py",
           says="The bubble meets the viscosity of water in the biomass too.",
           old="np.linalg.inv(each(20 * viscosity, block))",
           new="np.linalg.inv(each(20 * viscosity**0, block))"),
    Mutant("bubble-tenfold", "repro/model/flow.py",
           says="The condensed block is ten times too large.",
           old="np.linalg.inv(each(20 * viscosity, block))",
           new="np.linalg.inv(each(2 * viscosity, block))"),
    Mutant("bubble-mean-unweighted", "repro/model/flow.py",
           says="The bubble's mean velocity is that of a bubble of mean one.",
           old='np.einsum("tij,tj->ti", mobility, slope)',
           new='20 / 9 * np.einsum("tij,tj->ti", mobility, slope)'),
    Mutant("bubble-block-isotropic", "repro/model/flow.py",
           says="The traction form's bubble has the Laplacian form's block.",
           old="        block = block + G\n",
           new="        block = 1.0 * block\n"),
)
