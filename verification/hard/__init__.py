"""Hard cases: starved, exhausted, fast, still, viscous, in contact, grown unevenly, remeshed, drawn at random.

Each is run with every preset; see :mod:`verification.hard_cases` for the matrix.
"""

from verification.hard import contact, flow, growth, meshes, registered, runs, substrates

CASES = tuple(sorted((case for module in (substrates, flow, contact, growth, meshes, runs) for case in module.CASES),
                     key=lambda case: case.number))
registered.register(CASES)
