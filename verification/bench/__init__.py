"""``make bench``: error against time of every choice of method, cost against size, and what is claimed of both.

A *part* is a function ``name_part(quick) -> dict``: base, size, scenes and memory (:mod:`.runs`), box and channel
against other codes (:mod:`.users`). What they measure is kept in ``verification/report/bench.json`` (:mod:`.record`),
judged and drawn as ``verification/report/bench_*.svg`` (:mod:`.told`).

Times are of one machine in one run: quote the ratios. Importing the packages is not counted in them, nor is what a
library compiles before its first solution.
"""
