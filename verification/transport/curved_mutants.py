"""Wrong changes to the substrates on curved triangles that cases of this stage must catch."""

from verification.mutants import Mutant

TRANSPORT = "repro/curved/transport.py"
CURVED = (
    Mutant("curved-outlet-forgotten", TRANSPORT,
           says="What flows out through the outlet is left out of the weak form.",
           old="place[:, None, :]] += blocks",
           new="place[:, None, :]] += 0 * blocks"),
    Mutant("curved-fluid-diffusivity", TRANSPORT,
           says="Substrates diffuse in the biomass as in water.",
           old="np.where(mesh.biomass, s.diffusivity_in_aggregate, s.diffusivity)",
           new="np.where(mesh.biomass, s.diffusivity, s.diffusivity)"),
    Mutant("paired-without-decay", "repro/model/kinetics.py",
           says="Decay takes up no acceptor.",
           old="acceptor_to_donor_ratio * rate + decay_demand(kinetics) * m_a, rate",
           new="acceptor_to_donor_ratio * rate, rate"),
    Mutant("curved-unpaired", TRANSPORT,
           says="Below zero each substrate is taken up on its own, so that the two are not in proportion.",
           old="return law.paired_uptake(acceptor, donor, problem.substrates, problem.kinetics)",
           new="return law.uptake(acceptor, donor, problem.substrates, problem.kinetics)[:2]"),
    Mutant("curved-layers-ignored", "repro/curved/pore.py",
           says="Elements are not made smaller for concentration boundary layers.",
           old="BOUNDARY_LAYER = 0.15",
           new="BOUNDARY_LAYER = 0.0"),
    Mutant("cubic-outlet-order", "repro/curved/fields.py",
           says="The two inner nodes of an edge at an end are exchanged.",
           old="np.column_stack([a, *thirds(a, middle, b), b])",
           new="np.column_stack([a, *thirds(b, middle, a), b])"),
    Mutant("cubic-quadratic-uptake", TRANSPORT,
           says="The biomass is taken where the concentrations' first six functions have it.",
           old="density = active[problem.mesh.cells[biomass]] @ here.of.shape.T",
           new="density = active[problem.mesh.cells[biomass]] @ here.of.values[:, :6].T"),
)
