"""Wrong changes to `repro/` that cases of this stage must catch."""

from verification.mutants import Mutant

MUTANTS = (
    Mutant("gamma-sign", "repro/mesh_motion.py",
           says="gamma-sign",
           old="+ gamma * mass",
           new="- gamma * mass"),
    Mutant("walls-held", "repro/mesh_motion.py",
           says="walls-held",
           old="held[mesh.walls, 1] = True",
           new="held[mesh.walls] = True"),
    Mutant("stale-fluid", "repro/mesh_motion.py",
           says="stale-fluid",
           old="points[mesh.fluid] = mesh.points[mesh.fluid] + displacement",
           new="points[mesh.fluid] = mesh.points[mesh.fluid]"),
)
