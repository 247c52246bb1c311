"""Code blocks of a Markdown page, and functions that execute them unchanged."""

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
    """A language ("" for an indented block, which holds commands) and a text."""

    language: str
    text: str

    @property
    def commands(self) -> list[list[str]]:
        """The words of each command of a shell block, without comments."""
        if self.language not in SHELL | {""}:
            return []
        return [words for line in self.text.splitlines() if (words := shlex.split(line, comments=True))]


def blocks(page: Path) -> list[Block]:
    """Return the blocks of a page in their order."""
    text = page.read_text(encoding="utf-8")
    fenced = [(match.start(), Block(match[1], match[2])) for match in FENCED.finditer(text)]
    rest = FENCED.sub(lambda match: "\n" * len(match[0]), text)  # same length: positions stay
    indented = [(match.start(), Block("", match[0])) for match in INDENTED.finditer(rest)]
    return [block for _, block in sorted(fenced + indented, key=lambda pair: pair[0])]


def printed_lines(block: Block) -> list[str]:
    """Return the comments of a shell block: the lines that its commands print."""
    return [line[2:] for line in block.text.splitlines() if line.startswith("# ")]


def execute(words: list[str], capsys) -> tuple[int, str, str]:
    """Return status, stdout and stderr of one `repro` command in the current folder; "> FILE" writes its output."""
    target = words[words.index(">") + 1] if ">" in words else None
    arguments = words[1:words.index(">")] if target else words[1:]
    capsys.readouterr()
    status = main(arguments)
    printed = capsys.readouterr()
    if target:
        Path(target).write_text(printed.out, encoding="utf-8")
    return status, printed.out, printed.err


def is_repro(words: list[str]) -> bool:
    """Return whether a command is `repro`."""
    return words[0] in ("repro", ".venv/bin/repro")


def is_target(words: list[str]) -> bool:
    """Return whether a command is `make` with targets of the Makefile."""
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    return words[0] == "make" and all(re.search(rf"^{word}:", makefile, re.M) for word in words[1:])
