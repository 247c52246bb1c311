"""Mutants: small wrong changes of ``repro/``, each of which a case or a test must catch.

``make mutants`` runs all of them, ``python -m verification.mutants ID`` runs one. The modules of this package, apart
from :mod:`.runner`, are data: a mutant a row, a module a stage, and ``results.py`` for what users read. A row has an
id, what is wrong with the mutant, the text to change, which must occur once in the file, the text that replaces it, and
the tests that catch it. If a row has no tests, the cases that name the mutant in their mark must catch it.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Mutant:
    """A wrong change of the code.

    Parameters
    ----------
    id : str
        Name of the mutant, for marks and commands.
    file : str
        The file that it changes, from the top of the repository.
    says : str
        The error that the change makes.
    old : str
        The text to replace. It occurs once in the file.
    new : str
        The text that replaces it.
    tests : tuple of str
        Test ids of pytest that catch it; empty if cases do.

    Examples
    --------
    >>> from verification.mutants import Mutant
    >>> Mutant("no-gravity", "repro/model/flow.py", "gravity is twice as large", "g", "2 * g").tests
    ()
    """

    id: str
    file: str
    says: str
    old: str
    new: str
    tests: tuple[str, ...] = ()


def changes(file: str, *rows: tuple) -> tuple[Mutant, ...]:
    """Make the mutants of one file.

    Parameters
    ----------
    file : str
        The file, from the top of the repository.
    *rows : tuple of str
        A row per mutant: its id, the error that it makes, the old text, the new text, and the tests that catch it.

    Returns
    -------
    tuple of Mutant
        The mutants, in the order of the rows.

    Examples
    --------
    >>> from verification.mutants import changes
    >>> (mutant,) = changes("repro/model/flow.py", ("more-g", "gravity is twice as large", "g", "2 * g"))
    >>> mutant.id, mutant.file
    ('more-g', 'repro/model/flow.py')
    """
    return tuple(Mutant(id, file, says, old, new, tuple(tests)) for id, says, old, new, *tests in rows)
