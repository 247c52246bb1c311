"""The sample: work items drawn from all that cosmic-ray can make of ``repro/``, spread over its modules by size.

The share of a module is proportional to its number of statements, and at least one. Places are drawn first: operators,
numbers, conditions and loops. Then one change of each place is drawn, because the number of changes differs between
places. The draw depends on the seed and on the text of a line and its neighbours. A change of the code elsewhere does
not affect it.

Annotations, imports for types, and changes after which no value exists ("a @ b" to "a >> b") are left out, because
either no test or every test detects them.
"""

import ast
import hashlib
from collections import Counter, defaultdict
from heapq import nlargest
from itertools import islice
from operator import itemgetter
from pathlib import Path
from typing import Any

SEED = 2001
COUNT = 210
#: Operators that replace "X" by "Y" are taken if both belong to one of these groups of names of cosmic-ray.
_GROUPS = ({"Add", "Sub", "Mul", "Div", "FloorDiv", "Mod", "Pow"}, {"Eq", "NotEq", "Lt", "LtE", "Gt", "GtE"},
           {"BitOr", "BitAnd", "BitXor"}, {"Is", "IsNot"})
_SINGLE = {"AddNot", "ReplaceTrueWithFalse", "ReplaceFalseWithTrue", "ReplaceAndWithOr", "ReplaceOrWithAnd",
           "ReplaceBreakWithContinue", "ReplaceContinueWithBreak", "ExceptionReplacer", "NumberReplacer",
           "RemoveDecorator", "ZeroIterationForLoop", "ReplaceUnaryOperator_Delete_USub",
           "ReplaceUnaryOperator_Delete_Not", "ReplaceUnaryOperator_Delete_Invert",
           "ReplaceBinaryOperator_MatMult_Mul"}


def draw(count: int = COUNT) -> list:
    """Draw work items of cosmic-ray from the modules in the present folder."""
    from cosmic_ray.commands import init
    from cosmic_ray.work_db import use_db

    modules = sorted(Path("repro").rglob("*.py"))
    texts = {path: path.read_text(encoding="utf-8") for path in modules}
    with use_db("all.sqlite") as database:
        init(modules, database, {})
        places = _places(database.work_items, texts)
    available = {path: len(places[path]) for path in modules if places[path]}
    shares = shared({path: min(statements(texts[path]), most) for path, most in available.items()}, available, count)
    return [item for path, share in shares.items() for item in _drawn(places[path], texts[path], share)]


def statements(text: str) -> int:
    """Statements of a module, without docstrings."""
    return sum(isinstance(node, ast.stmt) and not (isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant))
               for node in ast.walk(ast.parse(text)))


def shared(sizes: dict, available: dict, count: int) -> dict:
    """Shares of ``count`` in proportion to sizes, at least one and at most those available, by largest remainders."""
    seats = [(name, sizes[name] / (seat + 0.5)) for name in available for seat in range(1, available[name])]
    more = nlargest(count - len(available), seats, key=itemgetter(1))
    return Counter([*available, *(name for name, _ in more)])


def _places(items, texts: dict[Path, str]) -> dict[Path, dict[tuple[int, int], list]]:
    """Work items by module and by the (line, column) that they change."""
    places: dict[Path, dict[tuple[int, int], list]] = defaultdict(lambda: defaultdict(list))
    unseen = {path: hidden(text) for path, text in texts.items()}
    for item in items:
        mutation = item.mutations[0]
        place = tuple(mutation.start_pos)
        is_hidden = any(start <= place < end for start, end in unseen[mutation.module_path])
        if is_used(mutation.operator_name.removeprefix("core/")) and not is_hidden:
            places[mutation.module_path][place].append(item)
    return places


def is_used(operator: str) -> bool:
    """Whether an operator of cosmic-ray is used."""
    pair = {*operator.split("_")[1:]}
    return operator in _SINGLE or bool(pair) and any(map(pair.issubset, _GROUPS))


def hidden(text: str) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """(start, end) of annotations and of blocks of imports for types."""
    parts: list[Any] = []
    for node in ast.walk(ast.parse(text)):
        parts += [getattr(node, "annotation", None), getattr(node, "returns", None)]
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            parts.append(node)
    return [((part.lineno, part.col_offset), (part.end_lineno, part.end_col_offset)) for part in parts if part]


def _drawn(places: dict[tuple[int, int], list], text: str, share: int) -> list:
    """``share`` work items of a module, at as many places, in the order of the text."""
    lines = text.splitlines()

    def rank(place: tuple[int, int], *more: object) -> str:
        near = [line.strip() for line in lines[max(place[0] - 2, 0):place[0] + 1]]
        return hashlib.sha256("|".join(map(str, (SEED, *near, place[1], *more))).encode()).hexdigest()

    def first(place: tuple[int, int]):
        return min(places[place], key=lambda item: rank(place, *_identity(item)))

    ranked = sorted(places, key=lambda place: (rank(place), place))
    drawn = islice((item for item in map(first, ranked) if _is_python(text, item)), share)
    return sorted(drawn, key=lambda item: item.mutations[0].start_pos)


def _identity(item) -> tuple[str, int]:
    return item.mutations[0].operator_name, item.mutations[0].occurrence % 2


def _is_python(text: str, item) -> bool:
    """Whether the changed module compiles. For cosmic-ray the stars of "**values" and "*, name" are operators."""
    from cosmic_ray.mutating import mutate_code
    from cosmic_ray.plugins import get_operator

    mutation = item.mutations[0]
    try:
        compile(mutate_code(text, get_operator(mutation.operator_name)(), mutation.occurrence), "", "exec")
    except SyntaxError:
        return False
    return True
