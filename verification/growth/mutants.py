"""Wrong changes to `repro/` that cases of this stage must catch."""

from verification.mutants import Mutant

MUTANTS = (
    Mutant("third-power", "repro/growth.py",
           says="third-power",
           old="A, PJ = J ** (-2 / 3), P * J\n    return",
           new="A, PJ = J ** (-1 / 3), P * J\n    return"),
    Mutant("tangent-coefficient", "repro/growth.py",
           says="tangent-coefficient",
           old="times(2 / 9 * A * trace",
           new="times(2 / 3 * A * trace"),
    Mutant("theta-power", "repro/growth.py",
           says="theta-power",
           old="(np.linalg.det(F) - theta)",
           new="(np.linalg.det(F) - theta**1.01)"),
    Mutant("stabilisation-power", "repro/growth.py",
           says="stabilisation-power",
           old="h**2 / 12 * theta ** (2 / 3)",
           new="h**2 / 12 * theta ** (5 / 3)"),
    Mutant("stabilisation-too-weak", "repro/growth.py",
           says="stabilisation-too-weak",
           old="h**2 / 12 * theta ** (2 / 3)",
           new="h**2 / 12e3 * theta ** (2 / 3)"),
)
