"""Wrong changes to the growth on curved triangles that cases of this stage must catch."""

from verification.mutants import Mutant

GROWTH = "repro/curved/growth.py"
CURVED = (
    Mutant("curved-grad-div-dropped", GROWTH,
           says="Nothing holds what the linear pressure leaves free of J, and growth has wrinkled equilibria.",
           old="GAMMA = 1.0",
           new="GAMMA = 0.0"),
    Mutant("curved-tangent-without-grad-div", GROWTH,
           says="The tangent leaves out the derivative of the grad-div term, so that it is none of the residual.",
           old="PJ + self._grad_div(theta) * at.J**2",
           new="PJ + 0 * self._grad_div(theta) * at.J**2"),
    Mutant("curved-constraint-sign", GROWTH,
           says="The pressure's forces in the tangent have the wrong sign.",
           old="saddle_blocks(K, -B)",
           new="saddle_blocks(K, B)"),
    Mutant("curved-expansion-forgotten", GROWTH,
           says="After a remesh growth starts from one again: the expansion of the reference is left out.",
           old="elements.at_points(theta, body.cells) * body.expanded",
           new="elements.at_points(theta, body.cells)"),
    Mutant("curved-theta-power", GROWTH,
           says="The constraint asks for J = sqrt(theta).",
           old="(self.at.dx * (at.J - theta)) @ elements.LINEAR",
           new="(self.at.dx * (at.J - theta ** 0.5)) @ elements.LINEAR"),
    Mutant("curved-stress-transposed", GROWTH,
           says="The first Piola-Kirchhoff stress is transposed: the force does not turn with the body.",
           old="self._forces(at.piola(P), self.weighted)",
           new="self._forces(np.swapaxes(at.piola(P), 2, 3), self.weighted)"),
)
