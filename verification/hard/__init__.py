"""Hard cases: starved, exhausted, fast, still, viscous, in contact, grown unevenly, remeshed, drawn at random.

Each is run with every preset; see :mod:`verification.hard_cases` for the matrix.
"""

from verification.hard import common, mechanics, runs, stages

CASES = tuple(sorted((*stages.SUBSTRATES, *stages.FLOWS, *mechanics.CASES, *runs.MESHES, *runs.RUNS),
                     key=lambda case: case.number))
common.register(CASES)
