"""Mutants made by machine, a sample of them spread over all of ``repro/``: ``make mutants-sampled``.

The hand-made mutants are where their authors expect the code to be fragile. These mutants are everywhere. cosmic-ray
makes them and stores the session, so that an interrupted session can continue. coverage.py records which test reaches
which line. A mutant is run against the tests that reach its line (:mod:`.reach`). The sample follows from a seed
(:mod:`.sample`). :mod:`.record` writes the committed files.
"""
