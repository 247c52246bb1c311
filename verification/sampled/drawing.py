"""The sample: mutants drawn from all that cosmic-ray's operators can make of ``repro/``, spread over modules by size.

A module gives as many as it has statements, in proportion, and one at least. Of a module, places are drawn first (an
operator, a number, a condition, a loop) and then one change of each: the ways to replace a "+" are not so many chances.
What is drawn follows from the seed and from the text of a line and its neighbours alone, so that a change of the code
elsewhere leaves a mutant as it is.

Left out is what no test can tell or every test does: annotations, imports for types, and changes that leave no value at
all ("a @ b" to "a >> b"), which would only make the share that is caught look better. Docstrings, ``__all__`` and the
texts of messages are strings, which no operator changes.
"""

from __future__ import annotations

import ast
from collections import Counter
from dataclasses import dataclass, replace
from functools import cache
from heapq import nlargest
from itertools import islice
from operator import itemgetter
from typing import Any

from verification.evidence.writing import ROOT
from verification.sampled.reach import digest

SEED = 2001
COUNT = 210
#: Replacements that are made, of "X" by "Y", where both are arithmetic, of order, of sets or of identity; by
#: cosmic-ray's names.
_ALIKE = ({"Add", "Sub", "Mul", "Div", "FloorDiv", "Mod", "Pow"}, {"Eq", "NotEq", "Lt", "LtE", "Gt", "GtE"},
          {"BitOr", "BitAnd", "BitXor"}, {"Is", "IsNot"})
_ALONE = {"AddNot", "ReplaceTrueWithFalse", "ReplaceFalseWithTrue", "ReplaceAndWithOr", "ReplaceOrWithAnd",
          "ReplaceBreakWithContinue", "ReplaceContinueWithBreak", "ExceptionReplacer", "NumberReplacer",
          "RemoveDecorator", "ZeroIterationForLoop", "ReplaceUnaryOperator_Delete_USub",
          "ReplaceUnaryOperator_Delete_Not", "ReplaceUnaryOperator_Delete_Invert",
          "ReplaceBinaryOperator_MatMult_Mul"}


@dataclass(frozen=True)
class Mutant:
    """The ``occurrence``-th change that an operator can make of a file of ``repro/``, from ``old`` to ``new``."""

    file: str
    line: int
    column: int
    operator: str
    occurrence: int
    old: str = ""
    new: str = ""

    @property
    def name(self) -> str:
        """16 hexadecimal digits that stand for the file, what is changed and what it becomes."""
        return digest(self.file, self.old, self.new, self.column, self.operator)


def sources() -> dict[str, str]:
    """Texts of the modules of repro/ by file."""
    folder = ROOT / "repro"
    return {path.relative_to(folder).as_posix(): path.read_text(encoding="utf-8")
            for path in sorted(folder.rglob("*.py"))}


def sample() -> list[Mutant]:
    """COUNT mutants of the modules."""
    texts = sources()
    places = {file: _places(file, text) for file, text in texts.items()}
    most = {file: len(found) for file, found in places.items() if found}
    shares = shared({file: min(statements(texts[file]), most[file]) for file in most}, most)
    return [mutant for file, share in shares.items() for mutant in _drawn(places[file], texts[file], share)]


def statements(text: str) -> int:
    """Statements of a module, docstrings not counted."""
    return sum(isinstance(node, ast.stmt) and not (isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant))
               for node in ast.walk(ast.parse(text)))


def shared(sizes: dict[str, int], most: dict[str, int]) -> dict[str, int]:
    """COUNT in proportion to sizes, one at least and no more than there are, by largest remainders."""
    seats = [(name, sizes[name] / (taken + 0.5)) for name in most for taken in range(1, most[name])]
    more = nlargest(COUNT - len(most), seats, key=itemgetter(1))
    return Counter([*most, *(name for name, _ in more)])


def _places(file: str, text: str) -> dict[tuple[int, int], list[Mutant]]:
    """Changes of a module by the (line, column) that they are made at."""
    from cosmic_ray.ast import ast_nodes, get_ast
    hidden = _hidden(text)
    nodes = list(ast_nodes(get_ast(text)))
    found: dict[tuple[int, int], list[Mutant]] = {}
    for name, operator in _operators().items():
        starts = [start for node in nodes for start, _ in operator.mutation_positions(node)]
        for occurrence, place in enumerate(starts):
            if not any(first <= place < last for first, last in hidden):
                found.setdefault(place, []).append(Mutant(file, *place, name, occurrence))
    return found


@cache
def _operators() -> dict[str, Any]:
    """Those of cosmic-ray that are taken, by name."""
    from cosmic_ray.operators.provider import OperatorProvider
    known = OperatorProvider()
    return {name: known[name]() for name in sorted(known) if name in _ALONE or _alike(name)}


def _alike(name: str) -> bool:
    pair = {*name.split("_")[1:]}
    return bool(pair) and any(map(pair.issubset, _ALIKE))


def _hidden(text: str) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """From where to where annotations and blocks of imports for types go."""
    hidden: list[Any] = []
    for node in ast.walk(ast.parse(text)):
        hidden += [getattr(node, "annotation", None), getattr(node, "returns", None)]
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            hidden.append(node)
    return [((part.lineno, part.col_offset), (part.end_lineno, part.end_col_offset)) for part in hidden if part]


def _drawn(places: dict[tuple[int, int], list[Mutant]], text: str, share: int) -> list[Mutant]:
    """``share`` mutants of a module, at as many places, in the order of the text."""
    lines = text.splitlines()

    def rank(mutant: Mutant, *more: object) -> str:
        near = [line.strip() for line in lines[max(mutant.line - 2, 0):mutant.line + 1]]
        return digest(SEED, mutant.file, *near, *more)

    def least(place: tuple[int, int]) -> Mutant:
        return min(places[place], key=lambda mutant: rank(mutant, mutant.operator, place[1], mutant.occurrence % 2))

    ranked = sorted(places, key=lambda place: (rank(places[place][0], place[1]), place))
    drawn = islice((mutant for mutant in map(least, ranked) if _is_python(mutated(text, mutant))), share)
    return [made(text, mutant) for mutant in sorted(drawn, key=lambda mutant: (mutant.line, mutant.column))]


def _is_python(text: str) -> bool:
    """cosmic-ray takes the stars of "**given" and of "*, name" for operators."""
    try:
        compile(text, "", "exec")
    except SyntaxError:
        return False
    return True


def made(text: str, mutant: Mutant) -> Mutant:
    """The mutant with the lines that it changes; of a decorator with the line that follows."""
    if mutant.operator == "RemoveDecorator":
        old, new = text.splitlines()[mutant.line - 1:mutant.line + 1]
        return replace(mutant, old=f"{old.strip()} {new.strip()}", new=new.strip())
    before, after = text.splitlines(), mutated(text, mutant).splitlines()
    while before and after and before[0] == after[0]:
        del before[0], after[0]
    while before and after and before[-1] == after[-1]:
        del before[-1], after[-1]
    return replace(mutant, old="\n".join(map(str.strip, before)), new="\n".join(map(str.strip, after)))


def mutated(text: str, mutant: Mutant) -> str:
    """The whole changed text of the module."""
    from cosmic_ray.ast import Visitor, get_ast

    class Change(Visitor):
        """Changes the one node that has the occurrence."""

        left = mutant.occurrence
        operator = _operators()[mutant.operator]

        def visit(self, node):
            """The node, changed if its turn has come."""
            for index, _ in enumerate(self.operator.mutation_positions(node)):
                self.left -= 1
                if self.left == -1:
                    return self.operator.mutate(node, index)
            return node

    return Change().walk(get_ast(text)).get_code()
