"""Where a mutant changes the code: a function, and code in it whose syntax tree occurs there once.

The old and the new code are an expression, a statement or consecutive statements. Their trees are compared, so layout
and comments do not matter. An f-string is compared as a whole. Only the source of the old code is replaced.

If the function lacks the old code, its names may have changed. Then code matches that differs in names of variables and
attributes alone, consistently, if the old names have left the function. The new code takes the new names.

If the file lacks the function, the old code is sought in functions of the same name in other classes of the file, in
the whole file, in functions of the same name in the package, and in the whole package. The first of these that has the
code must have it once. Only in the first of them may names have changed.

The text of a file that is not Python is replaced as it is, and must occur once.
"""

import ast
import builtins
import contextlib
import math
import textwrap
from collections.abc import Iterator
from functools import lru_cache
from itertools import accumulate
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

#: Fields of syntax trees that have the name of a variable, argument, function, module or attribute.
NAMES = ("id", "arg", "name", "asname", "module", "attr")
#: Names of other people's code. One of them in place of another, such as max for min, is no new name.
FOREIGN = {*dir(builtins), *dir(math), *dir(np), *dir(np.ndarray), *dir(np.linalg)}

#: {(kind of the name, old name): new name}.
Names = dict[tuple[str, str], str]


class AnchorError(ValueError):
    """The code to change is not in one place, or the change is none."""


class Scope(NamedTuple):
    """A part of a file: a function, or all of it. lines: the number of lines of the file."""

    file: Path
    lines: int
    tree: ast.Module
    part: ast.AST


class Place(NamedTuple):
    """Consecutive nodes in a field of their parent, and those of their names that differ from the mutant's."""

    scope: Scope
    parent: ast.AST
    field: str
    nodes: list[Any]
    names: Names


def change(root: Path, file: str, function: str, old: str, new: str) -> tuple[str, str]:
    """Change the code of a file, or of the file that the code was moved to.

    Parameters
    ----------
    root : Path
        The folder of the project.
    file : str
        The file, from this folder.
    function : str
        Qualified name of a function or class, "System.assemble"; "" is the whole file.
    old, new : str
        The code to replace, and the code that replaces it.

    Returns
    -------
    tuple of str
        The changed file, and its text.

    Raises
    ------
    AnchorError
        If the old code is not in one place, or the change is none.
    """
    if not file.endswith(".py"):
        text = (root / file).read_text(encoding="utf-8")
        if text.count(old) != 1 or old == new:
            raise AnchorError(f"the text is in {text.count(old)} places, not in one, or the change is none")
        return file, text.replace(old, new)
    before, after = _parse(old, new)
    for scopes, renames in _search(root, root / file, function):
        if found := [place for scope in scopes for place in _places(scope, before, renames)]:
            break
    if len(found) != 1:
        lines = ", ".join(f"{place.scope.file.relative_to(root)}:{place.nodes[0].lineno}" for place in found)
        raise AnchorError(f"the code is in {len(found)} places, not in one: {lines}")
    return found[0].scope.file.relative_to(root).as_posix(), _replace(found[0], after, new)


def _parse(*codes: str) -> list[list[Any]]:
    """The nodes of some code: one expression each, or else statements each."""
    try:
        parts = [ast.parse(textwrap.dedent(code)).body for code in codes]
    except SyntaxError:
        try:
            return [[ast.parse(f"({code}\n)", mode="eval").body] for code in codes]
        except SyntaxError as error:
            raise AnchorError(f"the code is neither an expression nor statements: {error}") from None
    if all(len(part) == 1 and isinstance(part[0], ast.Expr) for part in parts):
        return [[part[0].value] for part in parts]  # type: ignore[attr-defined]
    return [*parts]


def _search(root: Path, file: Path, function: str) -> Iterator[tuple[list[Scope], bool]]:
    """Where to look, one after the other, and whether names may have changed there."""
    own = [_whole(file)] if file.exists() else []
    if named := [part for scope in own for name, part in _functions(scope) if name == function]:
        yield named, True
        return
    package = root / file.relative_to(root).parts[0]
    for files in (own, package.rglob("*.py")):
        scopes = [_whole(each) if isinstance(each, Path) else each for each in files]
        parts = [(name.split(".")[-1], part) for scope in scopes for name, part in _functions(scope)]
        yield [part for name, part in parts if name and name == function.split(".")[-1]], files is own
        yield scopes, False


def _whole(file: Path) -> Scope:
    return _parsed(file, file.read_text(encoding="utf-8"))


@lru_cache(maxsize=4)  # neighbouring rows change one file
def _parsed(file: Path, text: str) -> Scope:
    tree = ast.parse(text)
    return Scope(file, len(text.split("\n")), tree, tree)


def _functions(scope: Scope, name: str = "") -> Iterator[tuple[str, Scope]]:
    """Yield the qualified names and parts of a file, of its functions and of its classes. That of the file is ""."""
    if isinstance(scope.part, ast.Module | ast.FunctionDef | ast.ClassDef):
        yield name, scope
    for node in (each for each in ast.iter_child_nodes(scope.part) if not isinstance(each, ast.expr)):
        inner = f"{name}.{node.name}".lstrip(".") if isinstance(node, ast.FunctionDef | ast.ClassDef) else name
        yield from _functions(scope._replace(part=node), inner)


def _places(scope: Scope, old: list[Any], renames: bool) -> list[Place]:
    """The places of a scope that have the old code, or else those that have it with other names."""
    inside = [*ast.walk(scope.part)]
    ids, present = {*map(id, inside)}, {key for node in inside for _, key in _named(node)}
    places: list[Place] = []
    for tree in (scope.part, scope.tree):  # the old code may be the function itself
        for parent, field, nodes in _runs(tree, len(old), isinstance(old[0], ast.stmt)):
            names: Names = {}
            if id(nodes[0]) in ids and _alike(old, nodes, names):
                changed = {key: new for key, new in names.items() if key[1] != new}
                if not changed or renames and _may_change(changed, names, present):
                    places.append(Place(scope, parent, field, nodes, changed))
        if places:
            break
    return [place for place in places if not place.names] or places


def _may_change(changed: Names, names: Names, present: set[tuple[str, str]]) -> bool:
    """Whether names of a function may have changed so: the old ones left, and no two became one."""
    distinct = len({(kind, new) for (kind, _), new in names.items()}) == len(names)
    return distinct and not changed.keys() & present and not any(
        {old, new} <= FOREIGN for (_, old), new in changed.items())


def _runs(tree: ast.AST, count: int, statements: bool) -> Iterator[tuple[ast.AST, str, list[Any]]]:
    """Yield (parent, field, nodes) of consecutive statements, or of each expression. The parts of an f-string are left
    out: Python 3.11 has no positions of them."""
    for field, value in ast.iter_fields(tree):
        nodes = [node for node in (value if isinstance(value, list) else [value]) if isinstance(node, ast.AST)]
        for first in range(len(nodes) - count + 1):
            if isinstance(nodes[first], ast.stmt if statements else ast.expr):
                yield tree, field, nodes[first:first + count]
        for node in nodes:
            if not isinstance(node, ast.JoinedStr):
                yield from _runs(node, count, statements)


def _named(node: ast.AST) -> Iterator[tuple[str, tuple[str, str]]]:
    """Yield (field, (kind, name)) of the names of a node. A keyword counts as an attribute of what is made with it."""
    kind = "attribute" if isinstance(node, ast.Attribute | ast.keyword) else "variable"
    for field in NAMES:
        if isinstance(name := getattr(node, field, None), str):
            yield field, (kind, name)


def _alike(old: Any, code: Any, names: Names) -> bool:
    """Whether two trees differ in names alone, each always in the same way. ``names`` collects all names."""
    if type(old) is not type(code):
        return False
    if isinstance(old, list):
        return len(old) == len(code) and all(_alike(*pair, names) for pair in zip(old, code))
    if not isinstance(old, ast.AST):
        return old == code
    own, others = dict(_named(old)), dict(_named(code))
    return own.keys() == others.keys() and all(
        names.setdefault(own[field], others[field][1]) == others[field][1] if field in own
        else _alike(getattr(old, field, None), getattr(code, field, None), names) for field in old._fields)


def _replace(place: Place, new: list[Any], code: str) -> str:
    """The source of a file with the new code in a place. Its statement there has the tree with the new nodes."""
    if place.names:
        for node in (node for each in new for node in ast.walk(each)):
            for field, key in [*_named(node)]:
                setattr(node, field, place.names.get(key, key[1]))
        code = "\n".join(map(ast.unparse, new))
    if [*map(ast.dump, place.nodes)] == [*map(ast.dump, new)]:
        raise AnchorError("the change is none")
    tree, line = place.scope.tree, place.nodes[0].lineno
    whole = place.nodes if place.parent is tree else [next(part for part in tree.body if part.end_lineno >= line)]
    with _changed_tree(place, new):
        after = [*map(ast.dump, new if place.parent is tree else whole)]
    above, below = _first_line(whole[0]) - 1, place.scope.lines - whole[-1].end_lineno
    code = textwrap.dedent(code).strip()
    for text in (_with_text(place, code), _with_text(place, f"({code})")):
        lines = text.split("\n")
        with contextlib.suppress(SyntaxError):
            if [*map(ast.dump, ast.parse("\n".join(lines[above:len(lines) - below])).body)] == after:
                return text
    raise AnchorError("the new code has another meaning in its place; change a larger part")


@contextlib.contextmanager
def _changed_tree(place: Place, new: list[Any]) -> Iterator[None]:
    """Put new nodes in a place, within a context."""
    value = getattr(place.parent, place.field)
    if isinstance(value, list):
        first = next(k for k, node in enumerate(value) if node is place.nodes[0])
        value[first:first + len(place.nodes)] = new
        yield
        value[first:first + len(new)] = place.nodes
    else:
        setattr(place.parent, place.field, new[0])
        yield
        setattr(place.parent, place.field, value)


def _first_line(node: Any) -> int:
    """The line where a node begins, with its decorators."""
    return min([node.lineno, *(each.lineno for each in getattr(node, "decorator_list", ()))])


def _with_text(place: Place, text: str) -> str:
    """The source of a file with a text in a place, indented as its first node."""
    source = place.scope.file.read_bytes()
    starts = [0, *accumulate(len(line) + 1 for line in source.split(b"\n"))]
    first, last = place.nodes[0], place.nodes[-1]
    start, end = starts[_first_line(first) - 1] + first.col_offset, starts[last.end_lineno - 1] + last.end_col_offset
    indented = textwrap.indent(text, first.col_offset * " ").lstrip(" ")
    return (source[:start] + indented.encode() + source[end:]).decode()
