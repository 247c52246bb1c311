"""Steady diffusion and dual Monod uptake in two dimensions, (7)-(8) without flow, by finite differences (py-pde).

    D lap C = X q(C_A, C_D),   C = supply at x = -a and x = a,   no flux through y = 0 and y = W

on a Cartesian grid of square cells. The uptake of a cell is proportional to its fraction of biomass. D is the same in
fluid and biomass, so that py-pde's Laplacian L C + g applies. Its matrix follows from applying it to zero and to five
patterns; no two cells of a pattern are neighbours of the same cell. Newton's method solves for both substrates with
this matrix. Nothing is compiled.

The scheme is of second order if the biomass's sides follow the cells. A curved side cuts cells: the fractions keep the
amount of uptake correct, but shift its location by a fraction of a cell.
"""
import numpy as np
import scipy.sparse as sp
from pde import CartesianGrid, ScalarField
from scipy.sparse.linalg import splu

from reference.monod import sink, sink_derivative, solve_steady

TOLERANCE = 1e-11
#: Options of SuperLU: the diagonal dominates, and pivoting would destroy the ordering.
NO_PIVOTS = {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}}
#: Number of patterns. The five cells of the stencil have different values of x + 2 y modulo five.
PATTERNS = 5


class Box:
    """``cells`` across the width of [-a, a] x [0, W]; points (n, 2): their centres.

    part: (n,) -> function (points (n, 2), cell's side) -> the part of each cell that is biomass.
    """

    def __init__(self, cells, half_length, width, part):
        count = 2 * half_length * cells / width
        if round(count) != count:
            raise ValueError("the length must be a whole number of cells")
        self.grid = CartesianGrid([[-half_length, half_length], [0.0, width]], [round(count), cells])
        self.points = np.array(self.grid.cell_coords).reshape(-1, 2)
        self.part = part(self.points, width / cells)

    def _laplacian(self, supply):
        """(L, g) of py-pde's Laplacian L C + g with C = supply at both ends."""
        ends = {"x": {"value": float(supply)}, "y": {"derivative": 0.0}}

        def apply(field):
            return ScalarField(self.grid, field.reshape(self.grid.shape)).laplace(ends, backend="scipy").data.ravel()

        x, y = np.divmod(np.arange(len(self.points)), self.grid.shape[1])
        colour = (x + 2 * y) % PATTERNS
        constant = apply(np.zeros(len(colour)))
        responses = np.stack([apply((colour == c).astype(float)) - constant for c in range(PATTERNS)])
        return self._assemble(responses, colour), constant

    def _assemble(self, responses, colour):
        """The matrix, from the responses of the cells of each colour and of their four neighbours."""
        index = np.arange(len(colour)).reshape(self.grid.shape)
        pairs = [(index, index), (index[1:], index[:-1]), (index[:-1], index[1:]), (index[:, 1:], index[:, :-1]),
                 (index[:, :-1], index[:, 1:])]
        rows, columns = (np.concatenate([*map(np.ravel, side)]) for side in zip(*pairs))
        return sp.csc_array((responses[colour[columns], rows], (rows, columns)), shape=(len(colour),) * 2)

    def steady(self, diffusivity, supply, density, rates):
        """C (2, n) at the cells' centres; diffusivity, supply: pairs, acceptor first; density: X; rates: those of
        :mod:`reference.monod`. Raises RuntimeError if Newton's method fails."""
        pairs = [self._laplacian(s) for s in supply]
        matrix = sp.block_diag([d * pair[0] for d, pair in zip(diffusivity, pairs)], "csc")
        constant = np.concatenate([d * pair[1] for d, pair in zip(diffusivity, pairs)])
        load = density * self.part

        def balance(fields):
            return matrix @ fields + constant - sink(fields, load, rates)

        start = np.repeat(np.array(supply, float), len(self.points))
        return solve_steady(balance, lambda fields: matrix - sink_derivative(fields, load, rates), start,
                            TOLERANCE * np.abs(constant).max(),
                            lambda system, right: splu(system, **NO_PIVOTS).solve(right)).reshape(2, -1)


def half_disc(radius, parts=16):
    """The part of each cell within a disc around the origin, by ``parts`` x ``parts`` points."""
    def part(points, cell):
        offsets = cell * ((np.arange(parts) + 0.5) / parts - 0.5)
        return np.mean([np.hypot(points[:, 0] + a, points[:, 1] + b) < radius for a in offsets for b in offsets],
                       axis=0)
    return part


def block(half, height):
    """|x| < half, y < height: both must be whole numbers of cells."""
    return lambda points, cell: ((np.abs(points[:, 0]) < half) & (points[:, 1] < height)).astype(float)
