"""``repro docs [PAGE]``: print a page of the documentation that the package contains.

Without a page, list them.
"""

import re
from importlib.resources import files

from repro.runs.progress import say

#: Pages in the package, by name, and what each is about.
PAGES = {"scope": "what the model covers, what it leaves out, and tools for the rest",
         "quantities": "every column and field with unit, formula and range"}


def add(commands) -> None:
    """Add the parser of this command."""
    command = commands.add_parser(
        "docs", help="print a page of the documentation",
        description="Print a page of the documentation, in Markdown. Without PAGE, list the pages.")
    command.add_argument("page", metavar="PAGE", nargs="?", choices=PAGES,
                         help=f"a page: {', '.join(PAGES)}")
    command.set_defaults(call=call)


def call(options) -> int:
    """Print a page, or list the pages."""
    if options.page is None:
        for name, subject in PAGES.items():
            say(f"{name:14}{subject}")
    else:
        page = files("repro") / "pages" / f"{options.page}.md"
        # a file of the repository in place of a link to it, and formulas without TeX's signs
        text = re.sub(r"\[([^]]+)\]\((?!https?:)([^)]+)\)", r"\1 (docs/\2 in the repository)",
                      page.read_text(encoding="utf-8").removesuffix("\n"))
        say(re.sub(r"\$|\\(?:quad)?", "", text))
    return 0
