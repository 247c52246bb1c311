"""The law for networks of :mod:`repro.results.network`: its shapes, its table, its error, and independent test shapes.
`python -m verification.network` writes `repro/results/network.csv` and the page on it.

law, shapes   the law of resistance: its table, its error, its shapes
uptakes       the law of uptake
histories     heads and supplies of the throats in the example of a network
throats       the law and its bounds over these histories, for ten throats
runs          the same throats as whole runs
timed         the time of a sweep of all throats
page          `docs/network.md`
"""
