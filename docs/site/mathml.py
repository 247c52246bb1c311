"""Formulas as MathML, which browsers show without scripts or fonts of their own."""

from docutils import nodes
from latex2mathml.converter import convert


def visit_inline(translator, node: nodes.math) -> None:
    """Write a formula within a sentence."""
    translator.body.append(convert(node.astext()))
    raise nodes.SkipNode


def visit_block(translator, node: nodes.math_block) -> None:
    """Write a displayed formula with its number."""
    number = node.get("label", "").removeprefix("eq-").replace("-", ")-(")
    label = f'<span class="equation-number">({number})</span>' if number else ""
    translator.body.append(f'<div class="math"{_anchor(node)}>{convert(node.astext(), display="block")}{label}</div>')
    raise nodes.SkipNode


def _anchor(node: nodes.Element) -> str:
    """The attribute with the identifier of a formula."""
    return f' id="{node["ids"][0]}"' if node["ids"] else ""


def setup(app) -> dict:
    """Register the renderers of formulas."""
    app.add_html_math_renderer("mathml", inline_renderers=(visit_inline, None), block_renderers=(visit_block, None))
    app.config.html_math_renderer = "mathml"
    return {"parallel_read_safe": True}
