"""``make bench``: error against time of every method, cost against size, and the claims about both.

A *part* is a function ``name_part() -> dict``: base, size, scenes and memory (:mod:`.runs`), wide after contact
(:mod:`.after_contact`), box and channel against other codes (:mod:`.users`), and the command as a user types it
(:mod:`.commands`). The measurements are stored in ``verification/report/bench.json`` (:mod:`.record`). They are judged,
and drawn as ``verification/report/bench_*.svg`` (:mod:`.report`).

Times depend on the machine and the run: quote the ratios. They exclude the import of the packages and the compilation
of a library before its first solution.
"""
