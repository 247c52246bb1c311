"""The arrays of the ``.vtu`` files: each is defined here, once."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from repro.model.pore import Pore
from repro.model.solving import Solved
from repro.model.surface import STRETCH, surfaces
from repro.results.field_files import Grid
from repro.results.quantities import Quantity, is_modelled, is_solved
from repro.scene import Scene


@dataclass(frozen=True, eq=False)
class State:
    """A scene with the state of its pore, from which the arrays are computed.

    Stresses import the mechanics: a scene without growth does not load them.
    """

    scene: Scene
    pore: Pore
    solved: Solved

    @cached_property
    def J(self) -> np.ndarray:
        """(t, q) J, the volume ratio since t = 0, at the quadrature points of growth."""
        mesh = self.pore.mesh
        return mesh.by_triangle([body.solid.strained(mesh.points[region.nodes]).J
                                 for body, region in zip(self.pore.bodies, mesh.regions)])

    @property
    def theta(self) -> np.ndarray:
        """(t, q) theta at the same points."""
        return self.pore.mesh.by_triangle([body.theta for body in self.pore.bodies])

    @cached_property
    def stress(self) -> np.ndarray:
        """(t, q, 4) MPa, components xx, yy, zz, xy at the same points."""
        from repro.model import adhesion
        return adhesion.stress(adhesion.Loading.of(self.scene), self.pore)

    @property
    def largest_principal(self) -> np.ndarray:
        """(t, q) MPa, largest principal stress at the same points."""
        from repro.model import growth
        return growth.largest_principal(self.stress)

    def mean(self, value: np.ndarray) -> np.ndarray:
        """(t,) means of values (t, q) over each of the aggregates' triangles at t = 0."""
        dx = self.pore.mesh.by_triangle([body.solid.at.dx for body in self.pore.bodies])
        return (value * dx).sum(axis=1) / dx.sum(axis=1)


ORIGIN = "positions at t = 0"
#: Parts that an array may need: does a state have them?
NEEDS: dict[str, Callable[[State], bool]] = {
    "flow": lambda state: state.solved.flow is not None,
    "acceptor": lambda state: is_solved(state.solved, "acceptor"),
    "donor": lambda state: is_solved(state.solved, "donor"),
    "biomass": lambda state: state.scene.kinetics is not None,
    "growth": lambda state: state.scene.growth is not None and bool(state.pore.bodies),
    ORIGIN: lambda state: (NEEDS["growth"](state) and state.scene.growth.erosion is None
                           and all(body.origin_known for body in state.pore.bodies)),
    "stress": lambda state: NEEDS["growth"](state) and state.pore.accumulates}


@dataclass(frozen=True)
class Array(Quantity):
    """An array of a ``.vtu`` file: a quantity of the state of the pore.

    Parameters
    ----------
    name, words, formula : str
        As for :class:`Quantity`.
    value : callable
        Takes a State and returns an array: (N,) or (N, 2) at nodes, (T,) or (T, 2) in triangles,
        in the package's own units.
    label, needs : str
        As for :class:`Quantity`.
    yes_no, signed : bool
        As for :class:`Quantity`.
    jumps : str
        As for :class:`Quantity`.
    cells : bool
        True for a value per triangle, False for a value per node.
    body : bool
        True if it is defined only in the aggregate; it is NaN in the fluid.

    Examples
    --------
    >>> from repro.results.arrays import Array
    >>> x = Array("x_um", "coordinate x", "x", lambda state: state.pore.mesh.points[:, 0])
    >>> x.unit.symbol
    'um'
    """

    cells: bool = False
    body: bool = False

    def on_mesh(self, state: State) -> np.ndarray:
        """(N,) or (T,) values at all nodes or triangles of the mesh; (N, 3) for a vector."""
        value = self.reported(state)
        if value.ndim == 2:
            value = _three(value)
        if not self.body:
            return value
        mesh = state.pore.mesh
        values = np.full((len(mesh.cells if self.cells else mesh.points), *value.shape[1:]), np.nan)
        values[mesh.biomass if self.cells else mesh.body] = value
        return values


def _three(plane: np.ndarray) -> np.ndarray:
    """(N, 3) vectors from plane ones (N, 2)."""
    return np.column_stack([plane, np.zeros(len(plane))])


def _head(state: State) -> np.ndarray:
    return state.pore.mesh.with_middles(state.solved.flow.head)


def _concentration(name: str, state: State) -> np.ndarray:
    return getattr(state.solved.concentrations, name)


def _density(name: str, state: State) -> np.ndarray:
    space = state.pore.space
    full = space.reaction.dx * state.scene.kinetics.maximum_density
    return space.integration.to_nodes(getattr(state.pore, name) / full)


def _pressure(state: State) -> np.ndarray:
    mesh = state.pore.mesh
    return state.scene.growth.shear_modulus * mesh.with_middles(state.pore.pressure)[mesh.body]


def _region(state: State) -> np.ndarray:
    labels = state.scene.labels
    numbers = [labels.index(body.name) + 1 if body.name in labels else number
               for number, body in enumerate(state.pore.bodies, 1)]
    return np.array([0, *numbers], float)[state.pore.mesh.topology.region]


def _stretch(state: State) -> np.ndarray:
    mesh = state.pore.mesh
    stretches = [np.full(len(region.triangles), np.inf) for region in mesh.regions]
    for stretch, free_surface in zip(stretches, surfaces(state.pore)):
        np.minimum.at(stretch, free_surface.cells, free_surface.stretch)
    stretch = mesh.by_triangle(stretches)
    return np.where(np.isinf(stretch), np.nan, stretch)


def _stress(k: int, state: State) -> np.ndarray:
    return state.mean(state.stress[..., k])


_FITTED = "of the points where growth is integrated, fitted linearly in each triangle"

ARRAYS = (
    Array("velocity_m_per_d", "velocity", "u (1)-(5)",
          lambda state: state.solved.flow.velocity, needs="flow",
          signed=True),
    Array("head_cm", "head", "phi (1)-(5), zero in the mean over the outlet of the meshed part",
          _head, needs="flow", signed=True),
    *(Array(f"{name}_mg_per_L", name, "C (7)-(13)", partial(_concentration, name),
            needs=name, signed=True) for name in ("acceptor", "donor")),
    Array("active_biomass", "active biomass over X_m", f"X_A / X_m: {_FITTED}; zero in the fluid",
          partial(_density, "active"), needs="biomass", signed=True),
    Array("inert_biomass", "inert biomass over X_m", f"X_I / X_m: {_FITTED}; zero in the fluid",
          partial(_density, "inert"), needs="biomass", signed=True),
    Array("displacement_um", "displacement since t = 0", "x - X",
          lambda state: (state.pore.mesh.points - state.pore.origin)[state.pore.mesh.body],
          needs=ORIGIN, body=True, signed=True),
    Array("position_t0_um", "position at t = 0", "X, where the material was",
          lambda state: state.pore.origin[state.pore.mesh.body], needs=ORIGIN, body=True,
          signed=True),
    Array("pressure_MPa", "pressure P of the aggregate", "P (21), linear between the corners",
          _pressure, needs="stress", body=True, signed=True),
    Array("region", "aggregate (1) or fluid (0)",
          "1 in the aggregate's triangles; of several, their number in the scene from 1",
          _region, cells=True),
    Array("theta", "expansion theta", "(28)-(29), the mean over the triangle at t = 0",
          lambda state: state.mean(state.theta), needs=ORIGIN, cells=True, body=True),
    Array("J", "volume ratio J", "det dx/dX, the mean over the triangle at t = 0",
          lambda state: state.mean(state.J), needs=ORIGIN, cells=True, body=True),
    Array("surface_stretch", "elastic stretch along the free surface",
          f"{STRETCH}; in the triangles at the free surface, of two edges the lesser", _stretch,
          needs="growth", cells=True, body=True),
    *(Array(f"stress_{axes}_MPa", f"stress {axes}", f"Cauchy stress {axes}, of mu_L "
            "(J^(-5/3) (F F^T - tr C / 3) + P / mu_L), the mean over the triangle at t = 0",
            partial(_stress, k), needs="stress", cells=True, body=True, signed=True)
      for k, axes in enumerate(("xx", "yy", "zz", "xy"))),
    Array("largest_principal_stress_MPa", "largest principal stress",
          "largest eigenvalue of the Cauchy stress, the mean over the triangle at t = 0",
          lambda state: state.mean(state.largest_principal), needs="stress",
          cells=True, body=True, signed=True),
)


def fields(scene: Scene, pore: Pore, solved: Solved) -> Grid:
    """Compute the fields of an instant, at nodes or in triangles, named with their units.

    Positions are in um. In the fluid biomass is zero, and displacement, theta, J, stress and
    pressure P are NaN; nodes of the interface belong to the aggregate. Stress and P follow from the
    strain since t = 0: a scene whose new biomass is born stress-free has neither. If its positions
    at t = 0 fold on a new mesh, later fields have no displacement, position at t = 0, theta and J.
    """
    state = State(scene, pore, solved)
    modelled = [quantity for quantity in ARRAYS if is_modelled(quantity, NEEDS, state)]
    points = {quantity.name: quantity.on_mesh(state) for quantity in modelled if not quantity.cells}
    cells = {quantity.name: quantity.on_mesh(state) for quantity in modelled if quantity.cells}
    return Grid(_three(pore.mesh.points), pore.mesh.cells, points, cells, pore.time)
