"""Growth mechanics (2.3, 3.4) against closed forms, a made-up solution, quadratic elements and what must be conserved.
"""

from verification.growth import cross_code, cylinder, homogeneous, law, manufactured, patch, properties

__all__ = ["cross_code", "cylinder", "homogeneous", "law", "manufactured", "patch", "properties"]
