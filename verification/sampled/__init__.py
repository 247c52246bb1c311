"""Mutants made by machine, a sample of them spread over all of ``repro/``: ``make mutants-sampled``.

The mutants of :mod:`verification.kernel.mutants` are chosen by people who know where it hurts; these are not chosen.
The operators are cosmic-ray's, the sample follows from a seed (:mod:`.drawing`), and each mutant is run against the
tests that call the function it is in (:mod:`.reach`), the cheapest first, for at most 60 s (:mod:`.hunting`).

Measured, of the two libraries that are kept up (cosmic-ray 8.7.0, mutmut 3.8.1): cosmic-ray's operators are classes
over the nodes of parso that can be used alone; with three packages (cosmic-ray, parso, attrs) those taken here make
21 679 changes at 7 528 places of repro/, what runs at import among them, and give each as the text of a module. mutmut
copies every function into a trampoline beside all of its mutants, of ``model/gear.py`` (18 kB) 523 mutants in 547 kB
of text and 7 s, against 785 changes in 0.9 s; it leaves out what runs at import, and needs libcst, a terminal
interface and a configuration file.
"""
