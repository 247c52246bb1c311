"""Wrong changes to `repro/` that cases of this stage must catch."""

from verification.mutants import Mutant

MUTANTS = (
    Mutant("saddle-sign", "repro/assembly.py",
           says="saddle-sign",
           old="elements[:, a:, a:] = upper, -lower",
           new="elements[:, a:, a:] = upper, lower"),
    Mutant("tau-of-water", "repro/flow.py",
           says="tau-of-water",
           old="(stabilisation * viscosity) if order",
           new="(stabilisation * 1.0) * np.ones(len(viscosity)) if order"),
    Mutant("carried-by-u-plus", "repro/flow.py",
           says="carried-by-u-plus",
           old="UnitFlow(velocity, pressure, tau[:, None] * slope",
           new="UnitFlow(velocity, pressure, -tau[:, None] * slope"),
    Mutant("traction-transposed", "repro/flow.py",
           says="traction-transposed",
           old="np.block([[laplace + xx, xy], [yx, laplace + yy]])",
           new="np.block([[laplace + xx, yx], [xy, laplace + yy]])"),
    Mutant("inlet-not-scaled", "repro/flow.py",
           says="inlet-not-scaled",
           old="return profile * mesh.width / np.trapezoid(profile[at], heights[at])",
           new="return profile"),
    Mutant("correction-not-scaled", "repro/flow.py",
           says="correction-not-scaled",
           old="speed * unit.correction, scale * unit.loss",
           new="unit.correction, scale * unit.loss"),
    Mutant("quadratic-stabilised", "repro/flow.py",
           says="quadratic-stabilised",
           old="if order == 1 else np.zeros(len(viscosity))",
           new="if order < 3 else np.zeros(len(viscosity))"),
)
