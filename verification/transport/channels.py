"""What the one-dimensional cases share: narrow channels, meshed at random, with biomass from wall to wall in a slab.

Their references know nothing of y. Each size has several unrelated meshes, whose errors are averaged: in a channel of a
few elements' width those of a single mesh scatter by a factor of 2.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from repro.fem.mesh import PoreMesh
from repro.model import flow, transport
from repro.scene import load_scene
from verification import meshes, norms

SCENE = load_scene("base")
WIDTH, SLAB = 10.0, 40.0
#: Under plug flow the slab is 0 < x < SLAB; without flow |x| < SLAB, between films of fluid of thickness FILM or none.
CROSSED, FILM = (-20.0, 60.0), 20.0
#: Sizes of elements (um), and how many meshes of each: the coarse ones cost nothing and scatter most.
SIZES = (4.0, 2.0, 1.0, 0.5)
SAMPLES = {4.0: 12, 2.0: 6, 1.0: 3, 0.5: 1}
SECOND = "linear elements, lumped reaction: second order"


@cache
def meshed(size: float, sample: int, ends=CROSSED, slab=(0.0, SLAB)) -> PoreMesh:
    """One of the meshes of a size."""
    sides = tuple(side for side in slab if side not in ends)
    return following(WIDTH * (slab[1] - slab[0]), size, sample, ends, WIDTH,
                     lambda x, y: (x > slab[0]) & (x < slab[1]), across=sides)


def following(area: float, size: float, sample: int, ends, width: float, is_biomass, **lines) -> PoreMesh:
    """A mesh of the first random lattice whose triangulation follows all lines, so that the biomass has its area.

    Raises ValueError where none of a few does.
    """
    for attempt in range(9):
        grid = meshes.channel(ends, width, size, is_biomass, **lines, seed=int(1000 * size) + 100 * sample + attempt)
        if np.isclose(grid.areas[grid.biomass].sum(), area, rtol=1e-12):
            return grid
    raise ValueError(f"size {size:g}, sample {sample}: no mesh follows the sides of the biomass")


def plug_flow(grid: PoreMesh, speed: float) -> flow.Flow:
    """The same velocity everywhere."""
    count = len(grid.points)
    return flow.Flow(speed, np.column_stack([np.full(count, speed), np.zeros(count)]), np.zeros(count),
                     np.zeros((len(grid.triangles), 2)), 0.0, 0.0, 1.0)


def problem(grid: PoreMesh, speed: float | None, substrates=SCENE.substrates, law=SCENE.kinetics) -> transport.Problem:
    """Both substrates under plug flow, None: without flow."""
    return transport.problem(grid, None if speed is None else plug_flow(grid, speed), substrates, law)


def filled(grid: PoreMesh, density: float) -> np.ndarray:
    """The density at every node; the biomass triangles around it say how much of it counts."""
    return np.full(len(grid.points), density)


def decay_demand(law) -> float:
    """d_c f_d b of (7), 1/h."""
    return law.decay_oxygen_demand * law.degradable_fraction * law.decay_coefficient


def rates(law, substrates=SCENE.substrates) -> dict[str, float]:
    """The kinetics for the references."""
    return {"k": law.maximum_utilization_rate, "F": law.acceptor_to_donor_ratio, "decay": decay_demand(law),
            "K_A": substrates.acceptor.half_saturation, "K_D": substrates.donor.half_saturation}


def pair(name: str, substrates=SCENE.substrates) -> tuple[float, float]:
    """A number of both substrates, acceptor first."""
    return getattr(substrates.acceptor, name), getattr(substrates.donor, name)


def changed(which: str, **values):
    """The paper's substrates with other values for one of them."""
    return replace(SCENE.substrates, **{which: replace(getattr(SCENE.substrates, which), **values)})


def speed_of(peclet: float) -> float:
    """u (um/h) of a Peclet number u SLAB / D of the acceptor in water."""
    return peclet * SCENE.substrates.acceptor.diffusivity / SLAB


def distance(grid: PoreMesh, fields, exact) -> np.ndarray:
    """L2 over the mesh of nodal fields (2, N) less exact(x) (2, ...), acceptor and donor, over that of exact."""
    return np.array([norms.l2_error(grid.points, grid.triangles, fields[k], lambda x, y, k=k: exact(x)[k])
                     for k in (0, 1)])


def both(state: transport.Concentrations) -> np.ndarray:
    """(2, N) C_A and C_D."""
    return np.stack([state.acceptor, state.donor])


def averaged(measure, size: float, *given, samples=SAMPLES) -> dict[str, float]:
    """Root mean square of what ``measure(size, sample, *given)`` gives on each mesh of a size, name by name."""
    rows = [measure(size, sample, *given) for sample in range(samples[size])]
    return {name: float(np.sqrt(np.mean([row[name] ** 2 for row in rows]))) for name in rows[0]}


def along(grid: PoreMesh, field, x) -> np.ndarray:
    """A nodal field along the middle of the channel."""
    return norms.sample(grid.points, grid.triangles, field, np.column_stack([x, np.full(len(x), WIDTH / 2)]))


def at_heights(grid: PoreMesh, fields, x, heights: int = 5) -> np.ndarray:
    """(2, heights, n) nodal fields (2, N) at x (n,), at so many heights."""
    y = WIDTH * (np.arange(heights) + 0.5) / heights
    where = np.column_stack([np.tile(x, heights), np.repeat(y, len(x))])
    return norms.sample(grid.points, grid.triangles, fields.T, where).T.reshape(2, heights, -1)
