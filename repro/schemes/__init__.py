"""The two schemes that solve a scene, to be compared side by side.

    paper     linear triangles, stabilised flow, updates of the shape, contact by nodes; and the
              same as printed, which does not conserve mass
    curved    curved quadratic triangles, Taylor-Hood flow, midpoint rule, contact lines
    scheme    what a scheme chooses, and which choices go together

A preset of a scene is one of these schemes and a few numbers. Other combinations are for studies:
``repro.simulate(scene, scheme=replace(PAPER, carrier="u"))``.
"""

from repro.schemes.curved import CURVED
from repro.schemes.paper import PAPER, PRINTED
from repro.schemes.scheme import Scheme

__all__ = ["CURVED", "PAPER", "PRINTED", "Scheme"]
