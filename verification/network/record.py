"""What the law was made of and judged by, as a table, and the page that tells it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from repro.results import read_table
from repro.results.network import added_resistance, known
from verification.network.shapes import Sample

SHAPES = Path(__file__).with_name("shapes.csv")
COLUMNS = ["unseen", "grown", "spanned", "viscosity_ratio", "area_over_width2", "added_length_over_width"]
#: The lambda of the fit's shapes there: the paper's.
RATIO = 2000.0
#: Areas over W^2 that the page tells, before contact and after it.
TOLD = ((0.01, 0.03, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0, 1.2, 1.3, 1.4, 1.5), (1.6, 1.75, 2.0, 2.5, 3.0, 4.0, 4.5))


def row(one: Sample, which: int, unseen: int) -> list:
    """A row of SHAPES; which: of the sample's lambdas."""
    return [unseen, int(one.run is not None), int(one.spanned), one.ratios[which], one.share, one.lengths[which]]


def read(unseen: bool) -> dict[str, np.ndarray]:
    """The columns of the fit's shapes, or of those that it has not seen."""
    columns = read_table(SHAPES)
    return {name: values[columns["unseen"] == unseen] for name, values in columns.items()}


@dataclass(frozen=True, eq=False)
class Judged:
    """Of some shapes: apart (n,), ln of r over the law's; beyond (n,), the same over that of the bound on its side:
    within the bounds where it is one at most."""

    apart: np.ndarray
    beyond: np.ndarray

    @property
    def count(self) -> int:
        """How many shapes."""
        return len(self.beyond)

    @property
    def inside(self) -> int:
        """How many of them are within the bounds."""
        return int((self.beyond <= 1).sum())


def judged(columns: dict[str, np.ndarray]) -> Judged:
    """Shapes against the law, each at its lambda. Raises ValueError where one is outside the law's range."""
    shares, lengths, kinds, ratios = (columns[name] for name in ("area_over_width2", "added_length_over_width",
                                                                 "spanned", "viscosity_ratio"))
    laws = np.array([added_resistance(share, 1.0, kind, ratio) for share, kind, ratio in zip(shares, kinds, ratios)])
    law, least, most = np.log(laws.T)
    apart = np.log(lengths) - law
    return Judged(apart, apart / np.where(apart < 0, least - law, most - law))


def page(seen: dict[str, np.ndarray], found: Judged) -> str:
    """`docs/network.md`."""
    grown = int(seen["grown"].sum())
    worst = 100 * np.expm1(np.abs(found.apart))
    return f"""# A law for networks

Made by `python -m verification.network`. What an aggregate of area A adds to the head loss of a pore of width W, for
models of networks: `repro.added_resistance(area, width, spanned, viscosity_ratio)`.

    head loss = 12 nu u_ave / (g W^2) (L + r W),        r = r(A / W^2, lambda, spanned)

r W is the length of empty pore that resists as much as the aggregate adds. Stokes flow is linear and has no length of
its own, so r depends on neither u_ave nor W, nor on where the aggregate sits, if that is 1.5 W or more from the pore's
ends. Before contact r hardly depends on lambda until the film is thin; a body that spans the pore has r nearly in
proportion to lambda - 1: that of a plug with straight ends, (lambda - 1) A / W^2 exactly, less what its rounded ends
let pass.

At lambda = {RATIO:g}, with the bounds of shapes of the same area:

{_told(False)}

{_told(True)}

The table, `repro/results/network.csv`, has r for half-discs, and after contact the mean of what growth makes in
several runs. The bounds are the least and the largest r over that of the fit's {len(seen["grown"])} shapes, {grown} of
them grown in pores of 40 to 150 um at 0.5 to 6 m/d and W^2 / 2500 (W in um) to 20 mg/L of both substrates, the others
drawn: half-discs, bodies from 1 % thinner to 3 % thicker than a half-disc and leaning by up to 5 %, plugs with ends of
other lengths. Grown plugs are compared with the mean of the other runs. With less substrate the aggregate is thicker
before contact, as growth is limited by diffusion, and r larger than the bounds say: near contact r doubles where the
thickness grows by some 5 %.

Judged with {found.count} shapes that the fit has not seen, of sizes, outlines, places, widths, velocities, supplies and
lambdas drawn at random: {found.inside} are within the bounds; half of them are within {np.median(worst):.1f} % of the
law, the worst is {worst.max():.0f} % from it.

Outside its range (A / W^2 from {_range(False)} before contact and from {_range(True)} after it, lambda from 100 to
10 000) the function raises `ValueError`. It holds for the paper's viscous aggregate with its own condition on the
surface [E2]: with true continuity of traction a half-disc resists 0.2 % and a plug 8 to 17 % otherwise.
"""


def _range(spanned: bool) -> str:
    low, high = known(spanned)
    return f"{low:.3g} to {high:.3g}"


def _told(spanned: bool) -> str:
    """A table in Markdown."""
    shares = np.array(TOLD[spanned])
    lines = [f"| A / W^2, {'touching both walls' if spanned else 'before contact'} | r | least | most |",
             "|---|---|---|---|"]
    for share, *values in zip(shares, *added_resistance(shares, 1.0, spanned, RATIO)):
        lines.append(f"| {share:g} | {' | '.join(f'{value:.3g}' for value in values)} |")
    return "\n".join(lines)
