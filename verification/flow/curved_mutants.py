"""Wrong changes to the flow on curved triangles that cases of this stage must catch."""

from verification.mutants import Mutant

FLOW = "repro/curved/flow.py"
CURVED = (
    Mutant("curved-viscosity-swapped", FLOW,
           says="Water has the viscosity of biomass, and biomass that of water.",
           old="np.where(mesh.biomass, viscosity_ratio, 1.0)",
           new="np.where(mesh.biomass, 1.0, viscosity_ratio)"),
    Mutant("curved-loss-per-width", FLOW,
           says="The work of the inlet is taken as the loss, without the division by the flux.",
           old="@ value[mesh.inlet]) / mesh.width",
           new="@ value[mesh.inlet])"),
    Mutant("curved-inlet-parabola", FLOW,
           says="The inlet's parabola has a mean of two thirds.",
           old="value[mesh.inlet] = 6 * share * (1 - share)",
           new="value[mesh.inlet] = 4 * share * (1 - share)"),
    Mutant("curved-straight-divergence", FLOW,
           says="The divergence is that of one point a triangle, not integrated.",
           old="elements.LINEAR.T @ (at.dx[:, :, None] * slopes)",
           new="elements.LINEAR.T @ (at.dx[:, :, None] * slopes[:, :1])"),
    Mutant("curved-whole-pore-twice", FLOW,
           says="The loss of the whole pore counts the meshed part twice.",
           old="poiseuille_loss(length - (mesh.ends[1] - mesh.ends[0]), mesh.width)",
           new="poiseuille_loss(length, mesh.width)"),
)
