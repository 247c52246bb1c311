"""Laws for networks: what an aggregate does to a throat (section 5).

    resistance    the head loss that an aggregate adds: its law, with bounds
    uptakes       the uptake of both substrates, and the growth that follows from it
    throats       the public functions, for Table 1's kinetics or those of a scene
    own           the laws of a scene: states that are solved once, and their file
    arguments     the check of the arguments of both laws

A network model knows the area A of the aggregate in a throat of width W. Both laws depend on
A / W^2, and on whether the aggregate touches both walls. ``python -m verification.network`` makes
their table and constants, and ``docs/network.md`` has their errors.
"""
