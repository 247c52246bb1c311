"""A check in words, as the tables show it."""

from __future__ import annotations

from math import isnan

from verification.claims import HOLDS, Check
from verification.claims.accuracy import FEW
from verification.uncertainty import Bar, Estimate

HEAD = ("quantity", "paper", "ours", "bar", "order", "Fs", "accepted", "deviation")
LEGEND = ("bar: error bar, that of the mesh plus that of the time step. order, Fs: observed order and factor of safety "
          "of both. same: all values are the same, and the bar is nothing; none: no order fits; -: not varied; all: "
          "there is no limit to converge to, and the bar goes from the least to the largest value on all meshes and "
          "with all steps. A number that is itself an error or a difference may have a bar larger than itself. A range "
          "without a word holds for the whole bar. Under a deviation: is the paper's value inside our bar, inside a "
          f"few percent of it (up to {100 * FEW:g}, the accuracy that the paper states), or neither?")


def number(value: float) -> str:
    """Four digits."""
    return f"{value:.4g}"


def cells(check: Check) -> tuple[str, ...]:
    """A check with its bar, in the order of HEAD."""
    words = bar_words(check.bar)
    outcome = "" if check.outcome == HOLDS else f": {check.outcome}"
    against = f"; {check.against_paper}" if check.against_paper else ""
    return check.quantity, check.paper, number(check.ours), *words, check.accepted + outcome, check.deviation + against


def bar_words(bar: Bar) -> tuple[str, str, str]:
    """A bar, its orders, and its factors of safety."""
    if bar.mesh is None and bar.step is None:
        return f"{number(bar.low)} to {number(bar.high)}", "all", "all"
    half, pair = 0.5 * (bar.high - bar.low), (bar.mesh, bar.step)
    return f"± {half:.2g}" if half else "exact", "/".join(map(_order, pair)), "/".join(map(_factor, pair))


def _order(found: Estimate | None) -> str:
    if found is None:
        return "-"
    if found.factor == 0:
        return "same"
    return "none" if isnan(found.order) else f"{found.order:.1f}"


def _factor(found: Estimate | None) -> str:
    return f"{found.factor:g}" if found and found.factor else "-"
