"""A page in one file, with its style and scripts. It loads nothing, and escapes all text."""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Iterable, Sequence
from html import escape
from importlib import resources


def page(title: str, body: str, scripts: Sequence[str] = (), style: str = "page.css",
         rules: str = "") -> str:
    """A page with these scripts and this style of the package, and with further rules of style.

    The browser runs only scripts whose hash is in the policy.
    """
    rules = _content(style) + rules
    code = list(map(_content, scripts))
    run = "".join(f"<script>{text}</script>\n" for text in code)
    return (f'<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
            f'<meta http-equiv="Content-Security-Policy" content="{_policy(rules, code)}">\n'
            f'<meta name="viewport" content="width=device-width, initial-scale=1">\n'
            f"<title>{escape(title)}</title>\n<style>{rules}</style>\n</head>\n<body>\n"
            f'<pre id="errors" class="errors" hidden></pre>\n{body}\n{run}</body>\n</html>\n')


def _policy(style: str, code: Sequence[str]) -> str:
    """The content security policy of a page that has this style and these scripts, and loads no
    other file."""
    scripts = " ".join(map(_hash, code)) or "'none'"
    return (f"default-src 'none'; style-src {_hash(style)}; script-src {scripts}; base-uri 'none'; "
            "form-action 'none'")


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
    rows = list(rows)
    if not rows:
        return ""
    heads = "".join(f'<th scope="col"{_value(k)}>{escape(text)}</th>'
                    for k, text in enumerate(head))
    body = "".join(map(_row, rows))
    top = f"<thead><tr>{heads}</tr></thead>" if head else ""
    title = f"<caption>{escape(caption)}</caption>" if caption else ""
    return f'<div class="scroll"><table>{title}{top}<tbody>{body}</tbody></table></div>'


def _row(values: Sequence[object]) -> str:
    cells = "".join(f"<td{_value(k)}>{escape(str(value))}</td>" for k, value in enumerate(values))
    return f"<tr>{cells}</tr>"


def _value(column: int) -> str:
    return ' class="value"' if column else ""


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
    if unit and isinstance(value, str) and _six_digits(number):
        return f"{_six_digits(number)} {unit}"
    return str(value)


def _six_digits(text: str) -> str:
    """Format a number in a text with six digits; empty if it is not a number."""
    try:
        return f"{float(text):.6g}"
    except ValueError:
        return ""
