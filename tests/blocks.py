"""The blocks of a Markdown page, and what it takes to execute them as they stand."""

import re
import shlex
from dataclasses import dataclass
from pathlib import Path

from repro.cli import main

ROOT = Path(__file__).parents[1]
FENCED = re.compile(r"^```(\w*)\n(.*?)^```$", re.M | re.S)
INDENTED = re.compile(r"(?:^    \S.*\n)+", re.M)
SHELL = {"console", "sh", "bash"}


@dataclass(frozen=True)
class Block:
    """A language ("" for an indented block: commands) and a text."""

    language: str
    text: str

    @property
    def commands(self) -> list[list[str]]:
        """The words of each command of a block for a shell, comments left out."""
        if self.language not in SHELL | {""}:
            return []
        return [words for line in self.text.splitlines() if (words := shlex.split(line, comments=True))]


def blocks(page: Path) -> list[Block]:
    """In the order of the page."""
    text = page.read_text(encoding="utf-8")
    fenced = [(found.start(), Block(found[1], found[2])) for found in FENCED.finditer(text)]
    rest = FENCED.sub(lambda found: "\n" * len(found[0]), text)  # of the same length: places stay
    indented = [(found.start(), Block("", found[0])) for found in INDENTED.finditer(rest)]
    return [block for _, block in sorted(fenced + indented, key=lambda pair: pair[0])]


def told(block: Block) -> list[str]:
    """What a block for a shell says that its commands print: its comments."""
    return [line[2:] for line in block.text.splitlines() if line.startswith("# ")]


def execute(words: list[str], capsys) -> tuple[int, str, str]:
    """Exit status, output and errors of one `repro` command, in the present folder; "> FILE" writes its output."""
    target = words[words.index(">") + 1] if ">" in words else None
    arguments = words[1:words.index(">")] if target else words[1:]
    capsys.readouterr()
    status = main(arguments)
    printed = capsys.readouterr()
    if target:
        Path(target).write_text(printed.out, encoding="utf-8")
    return status, printed.out, printed.err


def is_repro(words: list[str]) -> bool:
    """Is it the command of this package?"""
    return words[0] in ("repro", ".venv/bin/repro")


def is_target(words: list[str]) -> bool:
    """Is it a target of the Makefile?"""
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    return words[0] == "make" and all(re.search(rf"^{word}:", makefile, re.M) for word in words[1:])
