"""The law for networks of :mod:`repro.results.network`: its shapes, its table, its error, and shapes that it has not
seen. `python -m verification.network` makes `repro/results/network.csv` and what is told of it."""
