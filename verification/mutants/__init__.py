"""Mutants: small wrong changes of ``repro/``, each of which a case or a test must catch.

``make mutants`` runs all of them, ``python -m verification.mutants ID`` runs one. The modules of this package, apart
from :mod:`.runner`, are data: a mutant a row, a module a stage, and ``results.py`` for what users read. A row has an
id, what is wrong with the mutant, the text to change, which must occur once in the file, the text that replaces it, and
the tests that catch it. A row without tests is a mutant that cases catch: those that name it in their mark.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Mutant:
    """A wrong change: ``old``, which occurs once in ``file``, becomes ``new``; ``says`` is what is wrong then.

    ``tests`` are the test ids of pytest that catch it; empty if cases do.
    """

    id: str
    file: str
    says: str
    old: str
    new: str
    tests: tuple[str, ...] = ()


def changes(file: str, *rows: tuple) -> tuple[Mutant, ...]:
    """Mutants of one file, a row each: id, what is wrong, the old text, the new text, and the tests that catch it."""
    return tuple(Mutant(id, file, says, old, new, tuple(tests)) for id, says, old, new, *tests in rows)
