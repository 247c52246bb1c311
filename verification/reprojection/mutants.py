"""Wrong changes to `repro/` that cases of this stage must catch."""

from verification.mutants import Mutant

MUTANTS = (
    Mutant("linear-transfer", "repro/reprojection.py",
           says="linear-transfer",
           old="return _solve_mass(new_points, new_triangles, right)",
           new="return interpolate(points, triangles, fields, new_points)"),
    Mutant("clip-two-sides", "repro/reprojection.py",
           says="clip-two-sides",
           old="for side in range(3):",
           new="for side in range(2):"),
    Mutant("corners-for-middles", "repro/reprojection.py",
           says="corners-for-middles",
           old="middles = 0.5 * (corners + np.roll(corners, -1, axis=1))",
           new="middles = corners"),
    Mutant("inverse-ratio", "repro/reprojection.py",
           says="inverse-ratio",
           old="field * before / np.where(there, after, 1.0)",
           new="field * after / np.where(before > 0, before, 1.0)"),
)
