"""The code that cases can reach: the stages of verification, the references, and the modules of repro they import.

Commands, pages, checkpoints and sweeps are not in it: no case exercises them, the tests do.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
#: The names that it exports come from modules that cases import by themselves.
API = ROOT / "repro" / "__init__.py"


def reached(folders: list[Path]) -> set[Path]:
    """The files of folders, and all of this project that these import, directly or not."""
    found: set[Path] = set()
    waiting = [path for folder in folders for path in folder.rglob("*.py")]
    while waiting:
        path = waiting.pop()
        if path not in found:
            found.add(path)
            waiting += [] if path == API else imported(path)
    return found


def imported(path: Path) -> Iterator[Path]:
    """Files of this project that a file imports, inside functions too."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        names = [alias.name for alias in node.names] if isinstance(node, ast.Import | ast.ImportFrom) else []
        if isinstance(node, ast.ImportFrom):
            names = [node.module or "", *(f"{node.module}.{name}" for name in names)]
        for name in names:
            module = ROOT.joinpath(*name.split("."))
            yield from (file for file in (module.with_suffix(".py"), module / "__init__.py") if file.is_file())
