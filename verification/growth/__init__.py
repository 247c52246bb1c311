"""Growth mechanics (2.3, 3.4) against closed forms, a made-up solution, quadratic elements and what must be conserved.
"""
