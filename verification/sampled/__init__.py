"""Mutants made by machine, a sample of them spread over all of ``repro/``: ``make mutants-sampled``.

The mutants of :mod:`verification.kernel.mutants` are chosen by people who know where it hurts; these are not chosen. The
operators are cosmic-ray's, the sample follows from a seed (:mod:`.drawing`), and each mutant is run against the tests
that call the function it is in, the cheapest first, for at most 60 s (:mod:`.trying`).

Measured, of the two libraries that are kept up (cosmic-ray 8.7.0, mutmut 3.8.1): cosmic-ray's operators are classes over
the nodes of parso, made to be used alone; with three packages (cosmic-ray, parso, attrs) they find COSMIC
in repro/, at import level too, and give each back as a whole file. mutmut's copy every function into a trampoline beside
all of its mutants, leave out whatever runs at import, and need libcst and a terminal interface; nothing of that is public.
"""
