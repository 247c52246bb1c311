"""Slow, quantitative cases that compare `repro` with `reference` and with the paper; a failure is an exit status."""
