"""Aggregates whose added resistance gives the law: half-discs, similar drawn bodies, and grown shapes."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from repro.march.simulation import simulate
from repro.model.meshing import seeded
from repro.model.pore import Pore
from repro.network.own import added_length
from repro.scene import load_scene
from verification.claims.runs import SUBSTRATES, until

#: Viscosity ratios lambda of the table.
RATIOS = (100.0, 200.0, 500.0, 1000.0, 2000.0, 5000.0, 10000.0)
#: Length of the pores over their width, with space for growth upstream.
LENGTH = 15.0
#: Width (um) of the pores of drawn shapes. The results do not depend on it.
WIDTH = 100.0
#: Numerics of the shapes of the law, over the entire pore, and of the compared shapes. On half-discs of R / W from 0.05
#: to 0.96 they differ from the preset `exact` by 0.2 % and by 0.8 % at most.
FINE = ('numerics.preset="accurate"', 'numerics.extent="full"')
QUICK = ('numerics.preset="fast"',)
#: Ranges of drawn bodies, which growth also makes before contact: thickness over that of the half-disc of the same
#: area, and displacement of the top to either side over its height.
THICKER, LEANING = (0.99, 1.03), 0.05
#: Ranges of drawn plugs: length of the contact surface with the lower wall less that with the upper wall, over W, and
#: the larger share of this length on one side.
ENDS, UPSTREAM = (1.15, 1.4), 0.6
#: Least supply (mg/L) over W^2 (um2). With less, diffusion limits growth, and bodies are thicker.
LEAST_SUPPLY = 1 / 2500
#: Hours of a drawn run.
END = 50
#: A quarter of an ellipse that is cut here meets the upper wall at an angle.
STEEPEST = np.radians(75.0)
#: A film is W / 50 at least.
THICKEST = 0.98


@dataclass(frozen=True)
class Growth:
    """A run from a half-disc.

    width: um; velocity: m/d; supply: mg/L of both substrates; radius, position: of the seed, um; end: h.
    """

    width: float
    velocity: float
    supply: float
    radius: float
    position: float
    end: int

    def scene(self):
        """The scene in the preset `fast`, with a row every hour."""
        aggregate = {"radius": f"{self.radius} um", "position": f"{self.position} um"}
        supplies = {name: {"supply": f"{self.supply} mg/L"} for name in SUBSTRATES}
        return load_scene({**tables(self.width, aggregate, self.velocity), "substrates": supplies, "growth": {}},
                          (*QUICK, *until(*range(self.end + 1))))


def drawn_run(random: np.random.Generator) -> Growth:
    """A run with a drawn width, velocity, supply and seed."""
    width, velocity = random.uniform(40, 150), log_uniform(random, 0.5, 6)
    supply = log_uniform(random, max(LEAST_SUPPLY * width**2, 4), 20)
    return Growth(width, velocity, supply, random.uniform(0.05, 0.15) * width, random.uniform(-0.5, 0.5) * width, END)


def log_uniform(random: np.random.Generator, low: float, high: float) -> float:
    """A number between two values, whose logarithm is uniform."""
    return float(np.exp(random.uniform(np.log(low), np.log(high))))


def tables(width: float, aggregate: dict, velocity: float = 1.0) -> dict:
    """A scene's pore (um), aggregate and flow (m/d)."""
    return {"pore": {"width": f"{width} um", "length": f"{LENGTH * width} um"}, "aggregate": aggregate,
            "flow": {"mean_velocity": f"{velocity} m/d"}}


@dataclass(frozen=True)
class Sample:
    """An aggregate.

    run: its growth, None if it is drawn; spanned: whether it touches both walls; share: A / W^2; ratios, lengths:
    lambdas, and r for each of them.
    """

    run: Growth | None
    spanned: bool
    share: float
    ratios: tuple[float, ...]
    lengths: tuple[float, ...]


def sample(pore: Pore, ratios: tuple[float, ...] = RATIOS, run: Growth | None = None) -> Sample:
    """The added lengths of an aggregate in its mesh."""
    share = pore.boundary.area / pore.mesh.width**2
    return Sample(run, pore.contact, share, ratios, tuple(added_length(pore.space, ratio) for ratio in ratios))


def half_disc(thickness: float, width: float = WIDTH, position: float = 0.0, elements=FINE) -> Pore:
    """A half-disc on the lower wall. thickness: over W; position: of its middle (um)."""
    aggregate = {"radius": f"{thickness * width} um", "position": f"{position} um"}
    return seeded(load_scene(tables(width, aggregate), elements))


def drawn(points: np.ndarray, width: float = WIDTH) -> Pore:
    """A body with an outline (K, 2), in widths of the pore."""
    text = [[f"{x!r} um", f"{y!r} um"] for x, y in (width * points).tolist()]
    return seeded(load_scene(tables(width, {"outline": text}), QUICK))


def body(share: float, thicker: float, leaning: float) -> np.ndarray:
    """(K, 2) half an ellipse of an area over W^2, `thicker` times as thick as the half-disc, sheared downstream."""
    radius = np.sqrt(2 * share / np.pi)
    angle = np.linspace(np.pi, 0.0, 61)
    y = radius * thicker * np.sin(angle)
    y[[0, -1]] = 0.0
    return np.column_stack([radius / thicker * np.cos(angle) + leaning * y, y])


def plug(share: float, ends: float, upstream: float) -> np.ndarray:
    """(K, 2) a plug of an area over W^2 whose ends are quarters of ellipses, cut where they are flat: `ends` long
    together over W, of which `upstream` is one end's share."""
    angle = np.linspace(0.0, STEEPEST, 25)
    x, y = (1 - np.cos(angle)) / (1 - np.cos(STEEPEST)), np.sin(angle) / np.sin(STEEPEST)
    y[-1] = 1.0
    beside = ends * float(np.trapezoid(x, y))
    base = share + beside
    left = np.column_stack([-base / 2 + upstream * ends * x, y])
    right = np.column_stack([base / 2 - (1 - upstream) * ends * x, y])
    return np.vstack([left, right[::-1]])


def grown(run: Growth, most: float, apart: float) -> Iterator[Pore]:
    """Yield shapes of a run up to an area over W^2, each larger than the last by a factor of at least `apart`."""
    last = 0.0
    for instant in simulate(run.scene()):
        share = instant.pore.boundary.area / run.width**2
        if share > most:
            return
        if share > apart * last:
            last = share
            yield instant.pore


def select(columns: dict[str, np.ndarray], rows: np.ndarray) -> dict[str, np.ndarray]:
    """Some rows of the columns of a table; rows: (n,) bool."""
    return {name: values[rows] for name, values in columns.items()}
