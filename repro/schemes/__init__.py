"""The schemes that solve a scene.

    paper     linear triangles, stabilised flow, updates of the shape, contact by nodes; PRINTED
              is the same scheme as printed, which does not conserve mass
    curved    curved quadratic triangles, Taylor-Hood flow, midpoint rule, contact lines
    scheme    the choices of a scheme, and their valid combinations

A preset is one of these schemes plus a few numbers. Other combinations are for studies:
``repro.simulate(scene, scheme=replace(PAPER, carrier="u"))``.
"""

from repro.schemes.curved import CURVED
from repro.schemes.paper import PAPER, PRINTED
from repro.schemes.scheme import UNRESOLVED, Scheme

__all__ = ["CURVED", "PAPER", "PRINTED", "UNRESOLVED", "Scheme"]
