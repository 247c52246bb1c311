"""Dual Monod uptake in a strip crossed by plug flow, (7)-(8) in one dimension, in FiPy's finite volumes.

FiPy discretises advection and diffusion, M C = b, by central differences with the strip's ends on faces. FiPy's outlet
passes nothing, advection included, unless the gradient is constrained on its face; the inlet passes u C_s, (11), as a
source in the first cell. The uptake is added cell by cell, and the equations

    V dC/dt = b - M C - V X q(C_A, C_D)

are solved by scipy. FiPy's own solvers stop at a residual of 1e-5 by default, which leaves 2e-4 of the uptake
unaccounted for on every grid, and its sweeps take minutes. Time is integrated in two ways: by scipy, with a negligible
error, and by backward Euler, which is FiPy's TransientTerm and of first order.
"""
import numpy as np
import scipy.sparse as sp
from fipy import CellVariable, CentralDifferenceConvectionTerm, DiffusionTerm, Grid1D
from scipy.integrate import solve_ivp
from scipy.sparse.linalg import spsolve

from reference.monod import sink, sink_derivative, solve_steady

TOLERANCE = 1e-10


def matrix(term, mesh):
    """FiPy's matrix of a term; the gradient at the outlet is zero."""
    field = CellVariable(mesh=mesh, value=1.0)
    field.faceGrad.constrain([0.0], where=mesh.facesRight)
    term.cacheMatrix()
    term.justResidualVector(var=field)
    return sp.csr_matrix(term.matrix.matrix)


def diffusion(mesh, diffusivity):
    """FiPy's diffusion term; diffusivity: a number for each cell."""
    return DiffusionTerm(coeff=CellVariable(mesh=mesh, value=diffusivity).harmonicFaceValue)


class Channel:
    """Equal cells between two ends; those at 0 < x < length are biomass of density X. supply, diffusivity, in_strip:
    pairs, acceptor first. Raises ValueError if no face lies on an end of the strip."""

    def __init__(self, cells, ends, velocity, supply, diffusivity, in_strip, density, rates, length):
        self.mesh = Grid1D(nx=cells, dx=(ends[1] - ends[0]) / cells) + (ends[0],)
        self.x = np.array(self.mesh.cellCenters.value[0])
        self.volume = (ends[1] - ends[0]) / cells
        faces = (np.array([0.0, length]) - ends[0]) / self.volume
        if not np.allclose(faces, np.round(faces)):
            raise ValueError("the strip's ends must lie on faces")
        self.density = np.where((self.x > 0) & (self.x < length), density, 0.0)
        self.load = self.volume * self.density
        self.rates, self.supply = rates, np.array(supply, float)
        spreads = [np.where(self.density > 0, *pair) for pair in zip(in_strip, diffusivity)]
        pairs = [self._transport(velocity, s, spread) for s, spread in zip(supply, spreads)]
        matrices, self.sources = zip(*pairs)
        self.transport = sp.block_diag(matrices, "csc")

    def _transport(self, velocity, supply, spread):
        """(M, b) of one substrate; b holds the inflow of the first cell."""
        source = np.zeros(len(self.x))
        source[0] = velocity * supply
        advection = CentralDifferenceConvectionTerm(coeff=(float(velocity),))
        return matrix(advection - diffusion(self.mesh, spread), self.mesh), source

    def _balance(self, fields):
        """V dC/dt (2n,) of all C_A and then all C_D."""
        return np.concatenate(self.sources) - self.transport @ fields - sink(fields, self.load, self.rates)

    def _derivative(self, fields):
        """Derivative of :meth:`_balance`, (2n, 2n)."""
        return sp.csc_array(-self.transport - sink_derivative(fields, self.load, self.rates))

    def steady(self):
        """Steady (C_A, C_D) (2, n) at the cells' centres ``x``. Raises RuntimeError if Newton's method fails."""
        return self._solve(self._balance, self._derivative, np.repeat(self.supply, len(self.x))).reshape(2, -1)

    def _solve(self, defect, derivative, fields):
        """The zero of ``defect``."""
        return solve_steady(defect, derivative, fields, TOLERANCE * self.sources[0][0], spsolve)

    def transient(self, times):
        """C_A and C_D at each time, (times, 2, n). They start at the supply; the tolerance in time is 1e-8."""
        history = solve_ivp(lambda t, y: self._balance(y) / self.volume, (0.0, times[-1]),
                          np.repeat(self.supply, len(self.x)), jac=lambda t, y: self._derivative(y) / self.volume,
                          method="BDF", t_eval=times, rtol=1e-8, atol=1e-8)
        return history.y.T.reshape(len(times), 2, -1)

    def backward_euler(self, times, steps):
        """C_A and C_D at each time by FiPy's scheme, V (C - C_old) / dt = V dC/dt; each interval has ``steps`` equal
        steps."""
        fields, states = np.repeat(self.supply, len(self.x)), []
        for interval in np.diff([0.0, *times]):
            for _ in range(steps):
                fields = self._implicit_step(fields, self.volume * steps / interval)
            states.append(fields.reshape(2, -1))
        return np.array(states)

    def _implicit_step(self, old, storage):
        """One step of backward Euler, V / dt = storage."""
        return self._solve(lambda new: self._balance(new) - storage * (new - old),
                            lambda new: self._derivative(new) - storage * sp.eye_array(len(new), format="csc"), old)
