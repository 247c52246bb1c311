"""``make bench``: error against time of every choice of method, cost against size, and what is claimed of both.

A *part* is a module here with ``run(quick) -> dict``: flow, transport, growth, transfer, base, size, scenes, memory.
What they measure is kept in ``verification/report/bench.json`` (:mod:`verification.bench.record`), judged in
:mod:`verification.bench.verdicts` and drawn as ``verification/report/bench_*.svg``.

Times are of one machine in one run: quote the ratios. Importing the packages is not counted in them, and stated apart;
neither is what a library compiles before its first solution.
"""
