"""A page in one file, with its style and scripts. It loads nothing, and escapes all text."""

import base64
import hashlib
import json
from collections.abc import Iterable, Sequence
from contextlib import suppress
from html import escape
from importlib import resources


def page(title: str, body: str, scripts: Sequence[str] = (), style: str = "page.css",
         rules: str = "") -> str:
    """A page with these scripts and this style of the package, and with further rules of style.

    The browser runs only scripts whose hash is in the policy, and loads no other file.
    """
    rules = _content(style) + rules
    code = list(map(_content, scripts))
    run = "".join(f"<script>{text}</script>\n" for text in code)
    permitted = " ".join(map(_hash, code)) or "'none'"
    policy = (f"default-src 'none'; style-src {_hash(rules)}; script-src {permitted}; "
              "base-uri 'none'; form-action 'none'")
    return (f'<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
            f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
            f'<meta name="viewport" content="width=device-width, initial-scale=1">\n'
            f"<title>{escape(title)}</title>\n<style>{rules}</style>\n</head>\n<body>\n"
            f'<pre id="errors" class="errors" hidden></pre>\n{body}\n{run}</body>\n</html>\n')


def _content(name: str) -> str:
    return resources.files("repro.report").joinpath(name).read_text(encoding="utf-8")


def _hash(text: str) -> str:
    """The source expression of a policy that permits this text."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode('ascii')}'"


def data(name: str, content: dict) -> str:
    """A block of data for a script. Its content cannot end the block."""
    text = json.dumps(content, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    return f'<script type="application/json" id="{name}">{text}</script>'


def section(title: str, *parts: str) -> str:
    """A section of the page with its heading; empty without parts."""
    return f"<section><h2>{escape(title)}</h2>{''.join(parts)}</section>\n" if any(parts) else ""


def table(caption: str, head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table; every column after the first has values. Empty without rows."""
    def cells(tag: str, values: Sequence[object]) -> str:
        classes = ["", *[' class="value"'] * len(values)]
        name = tag.partition(" ")[0]
        return "".join(f"<{tag}{kind}>{escape(str(value))}</{name}>"
                       for kind, value in zip(classes, values))

    body = "".join(f"<tr>{cells('td', row)}</tr>" for row in rows)
    heads = cells('th scope="col"', head)
    top = f"<thead><tr>{heads}</tr></thead>" if head else ""
    title = f"<caption>{escape(caption)}</caption>" if caption else ""
    return body and f'<div class="scroll"><table>{title}{top}<tbody>{body}</tbody></table></div>'


def flat(tables: object, key: str = "") -> dict[str, object]:
    """Nested tables as {"numerics.preset": value}; lists of values stay unchanged."""
    if isinstance(tables, list) and tables and all(isinstance(each, dict) for each in tables):
        tables = {str(number): each for number, each in enumerate(tables, 1)}
    if not isinstance(tables, dict):
        return {key: tables}
    flattened: dict[str, object] = {}
    for name, value in tables.items():
        flattened |= flat(value, f"{key}.{name}" if key else str(name))
    return flattened


def format_value(value: object) -> str:
    """Format a value of a record: numbers have six digits, units are unchanged."""
    if isinstance(value, bool) or value is None:
        return {True: "yes", False: "no", None: "none"}[value]
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list):
        return ", ".join(map(format_value, value)) or "none"
    number, _, unit = str(value).partition(" ")
    with suppress(ValueError):  # it is no number
        return f"{float(number):.6g} {unit}" if unit else str(value)
    return str(value)
