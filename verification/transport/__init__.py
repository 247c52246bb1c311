"""Substrates (2.2, 3.3) against closed forms, chosen solutions, FiPy, scipy and py-pde; and what must be conserved.

Where a reference has one dimension, the pore is a narrow channel, meshed at random, with biomass from wall to wall.
"""
