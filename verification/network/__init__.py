"""The laws for networks of :mod:`repro.network`: shapes of the fits, tables, errors, and independent tests.

`python -m verification.network` writes `repro/network/resistance.csv` and the page `docs/network.md`.

law, shapes   the law of resistance: its table, its error, its shapes
uptakes       the law of uptake
histories     heads and supplies of the throats in the example of a network
throats       the law and its bounds over these histories, for ten throats
runs          the same throats as whole runs
timed         the time of a sweep of all throats
page          `docs/network.md`
"""
