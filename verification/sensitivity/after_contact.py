"""How well wide is known after its contact with the opposite wall: conductivity, tips, and length of contact.

A contact surface grows by whole edges of the outline, so that a single row jumps, by an edge or two, with whatever
moves the instant at which a node joins. Its mean over the whole hours from contact to the end of Figure 6 does not. The
bar is that of `verification.uncertainty` from the converged solution on four sizes of elements and steps.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from repro.fem.outline import TOP
from repro.march import simulation
from repro.march.loop import Instant
from repro.results import M_PER_D
from verification.claims.evaluate import MESH_ORDERS
from verification.claims.growth_pattern import contact_length
from verification.claims.levels import converged
from verification.sensitivity.numbers import OF, Numbers, Runs, scene
from verification.uncertainty import estimate

SIZES = (0.5, 2**-0.5, 1.0, 2**0.5)
#: Whole hours (h) after contact, which comes at 34.3 h.
HOURS = tuple(map(float, range(35, 46)))
#: What is asked of the bars, in percent of the number.
ASKED = {"conductivity (m/d)": 1.0, "upstream tip (um)": 1.0, "downstream tip (um)": 1.0, "length of contact (um)": 2.0}


def of_after(said) -> Numbers:
    """Means over HOURS (geometric, of magnitudes) and values at the last of them. Raises LookupError where one of the
    hours is before contact."""
    rows = [instant for _, instant in simulation.steps(said) if instant and instant.pore.contact]
    if len(rows) != len(HOURS):
        raise LookupError(f"{len(rows)} of {len(HOURS)} rows are after contact")
    table = np.array([_row(each) for each in rows])
    means = np.exp(np.log(np.abs(table)).mean(axis=0))
    found = {f"mean of {name}": float(value) for name, value in zip(ASKED, means)}
    return found | {f"last {name}": float(abs(value)) for name, value in zip(ASKED, table[-1])}


def _row(now: Instant) -> list[float]:
    """In the order of ASKED."""
    outline = now.pore.boundary
    return [M_PER_D * now.solved.flow.conductivity, outline.upstream, outline.downstream, contact_length(outline, TOP)]


OF["after contact"] = of_after


def known(runs: Runs) -> list[dict]:
    """Each number on all sizes, its bar (%), and whether that is what is asked."""
    sizes = [runs.numbers(_scene(size)) for size in SIZES]
    return [told(f"{kind} {name}", [row[f"{kind} {name}"] for row in sizes], asked)
            for kind in ("mean of", "last") for name, asked in ASKED.items()]


def _scene(size: float):
    said = scene("wide", {}, *converged(size))
    return replace(said, name="after contact", output=replace(said.output, times=HOURS))


def told(quantity: str, values: list[float], asked: float) -> dict:
    """A number from its values on SIZES."""
    bar = 100 * estimate(SIZES, values, MESH_ORDERS).bar / abs(values[0])
    return {"quantity": quantity, "values": values, "bar_percent": bar, "asked_percent": asked, "kept": bar <= asked}
