"""Mutants: small wrong changes of ``repro/``, each of which a case or a test must catch.

``make mutants`` runs all of them, ``python -m verification.mutants ID`` runs one. The modules of this package, apart
from :mod:`.runner` and :mod:`.anchors`, are data: a mutant a row, a module a stage, and ``results.py`` for what users
read. A row has an id, what is wrong with the mutant, the function that it changes, the old code, the new code, and the
tests that catch it. If a row has no tests, the cases that name the mutant in their mark must catch it.

The old code must occur once in the function. Trees of syntax are compared, so a mutant survives changes of layout, of
names and of the place of its function. If an expression occurs twice, the row has the expression or statement around
it. :mod:`.anchors` says what counts as the same code.
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
    function : str
        Qualified name of the function or class that it changes, "System.assemble"; "" is the whole file.
    old : str
        The code to replace: an expression, a statement or consecutive statements. A file that is not Python has text.
    new : str
        The code that replaces it.
    tests : tuple of str
        Test ids of pytest that catch it; empty if cases do.

    Examples
    --------
    >>> from verification.mutants import Mutant
    >>> Mutant("more-g", "repro/model/flow.py", "gravity is twice as large", "fall", "g", "2 * g").tests
    ()
    """

    id: str
    file: str
    says: str
    function: str
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
        A row per mutant: its id, the error that it makes, the function, the old code, the new code, and the tests that
        catch it.

    Returns
    -------
    tuple of Mutant
        The mutants, in the order of the rows.

    Examples
    --------
    >>> from verification.mutants import changes
    >>> (mutant,) = changes("repro/model/flow.py", ("more-g", "gravity is twice as large", "fall", "g", "2 * g"))
    >>> mutant.id, mutant.file
    ('more-g', 'repro/model/flow.py')
    """
    return tuple(Mutant(id, file, says, function, old, new, tuple(tests))
                 for id, says, function, old, new, *tests in rows)
