"""Mutants made by machine, a sample of them spread over all of ``repro/``: ``make mutants-sampled``.

Other mutants are chosen by people who know where the code is fragile; these are not chosen. cosmic-ray makes them, and
keeps the session: an interrupted session goes on where it stopped. coverage.py says which test reaches which line, and
a mutant is run against the tests that reach its line (:mod:`.reach`). The sample follows from a seed (:mod:`.sample`),
and :mod:`.record` writes what is committed.
"""
