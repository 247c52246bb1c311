"""The law for networks of :mod:`repro.results.network`: its shapes, its table, its error, and independent test shapes.
`python -m verification.network` writes `repro/results/network.csv` and the page on it."""
