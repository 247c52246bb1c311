"""Dual Monod uptake in a strip crossed by plug flow, (7)-(8) in one dimension, in FiPy's finite volumes.

FiPy discretises advection and diffusion, M C = b, by central differences with the strip's ends on faces. FiPy's outlet
passes nothing, advection included, unless the gradient is constrained on its face; the inlet passes u C_s, (11), as a
source in the first cell. The uptake is added cell by cell, and the equations

    V dC/dt = b - M C - V X q(C_A, C_D)

are solved by scipy: FiPy's own solvers stop at a residual of 1e-5 unless told otherwise, which leaves 2e-4 of what is
taken up unaccounted for on every grid, and its sweeps take minutes.
"""
import numpy as np
import scipy.sparse as sp
from fipy import CellVariable, CentralDifferenceConvectionTerm, DiffusionTerm, Grid1D, LinearLUSolver
from scipy.integrate import solve_ivp
from scipy.sparse.linalg import spsolve

from reference.channel_bvp import uptake

RESTS, MOST, NUDGE = 1e-10, 100, 1e-6


class Channel:
    """Equal cells over ends, of which 0 < x < length are biomass of density X; supply, diffusivity, in_strip: pairs."""

    def __init__(self, cells, ends, velocity, supply, diffusivity, in_strip, density, rates, length):
        self.mesh = Grid1D(nx=cells, dx=(ends[1] - ends[0]) / cells) + (ends[0],)
        self.x = np.array(self.mesh.cellCenters.value[0])
        self.volume = (ends[1] - ends[0]) / cells
        self.density = np.where((self.x > 0) & (self.x < length), density, 0.0)
        self.rates, self.supply = rates, np.array(supply, float)
        spreads = [np.where(self.density > 0, *pair) for pair in zip(in_strip, diffusivity)]
        pairs = [self._transport(velocity, s, spread) for s, spread in zip(supply, spreads)]
        matrices, self.sources = zip(*pairs)
        self.transport = sp.block_diag(matrices, "csc")

    def _transport(self, velocity, supply, spread):
        """(M, b) of one substrate, the first cell's inflow taken out of FiPy's hands."""
        field = CellVariable(mesh=self.mesh, value=float(supply))
        field.faceGrad.constrain([0.0], where=self.mesh.facesRight)
        coefficient = CellVariable(mesh=self.mesh, value=spread).harmonicFaceValue
        terms = CentralDifferenceConvectionTerm(coeff=(float(velocity),)) - DiffusionTerm(coeff=coefficient)
        terms.cacheMatrix()
        terms.solve(var=field, solver=LinearLUSolver())
        matrix = sp.csr_matrix(terms.matrix.matrix)
        source = np.zeros(len(self.x))
        source[0] = velocity * supply
        return matrix, source

    def _rise(self, fields):
        """V dC/dt (2 cells,) of C_A and then C_D."""
        sinks = self.volume * self.density * np.stack(uptake(*fields.reshape(2, -1), self.rates))
        return np.concatenate(self.sources) - self.transport @ fields - sinks.ravel()

    def _slopes(self, fields):
        """Its derivative: the uptake's, cell by cell, by central differences."""
        both = fields.reshape(2, -1)
        shifts = NUDGE * np.eye(2)[:, :, None]
        columns = [(np.stack(uptake(*(both + d), self.rates)) - np.stack(uptake(*(both - d), self.rates))) / (2 * NUDGE)
                   for d in shifts]
        blocks = [[sp.diags_array(self.volume * self.density * columns[s][k]) for s in (0, 1)] for k in (0, 1)]
        return sp.csc_array(-self.transport - sp.block_array(blocks))

    def steady(self):
        """(C_A, C_D) at the cells' centres ``x``, at rest: Newton's method with halved steps."""
        fields = np.repeat(self.supply, len(self.x))
        for _ in range(MOST):
            rise = self._rise(fields)
            if np.abs(rise).max() < RESTS * self.sources[0][0]:
                return fields.reshape(2, -1)
            step, length = spsolve(self._slopes(fields), -rise), 1.0
            while np.linalg.norm(self._rise(fields + length * step)) > np.linalg.norm(rise) and length > 1e-3:
                length /= 2
            fields = fields + length * step
        raise RuntimeError(f"the finite volumes do not come to rest: {np.abs(rise).max():.2g}")

    def transient(self, end):
        """(C_A, C_D) after a time, from the supply everywhere."""
        found = solve_ivp(lambda t, y: self._rise(y) / self.volume, (0.0, end), np.repeat(self.supply, len(self.x)),
                          jac=lambda t, y: self._slopes(y) / self.volume, method="BDF", rtol=1e-8, atol=1e-8)
        return found.y[:, -1].reshape(2, -1)
