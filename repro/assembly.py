"""From element matrices to a sparse system: what depends on the mesh's connections alone is worked out once.

The weak forms are scikit-fem's (:func:`local` gives their element matrices); while a mesh only moves, its sparsity,
elimination order and the place of every element entry in the sparse matrix stay, and an assembly is one summation.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from repro import linear


def local(form, trial, test=None, **parameters) -> np.ndarray:
    """(T, test functions, trial functions) element matrices of a scikit-fem bilinear form."""
    test = trial if test is None else test
    data = form.coo_data(trial, test, **parameters).data.reshape(trial.Nbfun, test.Nbfun, -1)
    return np.moveaxis(data, (2, 1, 0), (0, 1, 2))


def each(coefficient: np.ndarray, elements: np.ndarray) -> np.ndarray:
    """Element matrices (T, a, b) times a coefficient (T,) of each triangle."""
    return coefficient[:, None, None] * elements


def mass(areas: np.ndarray) -> np.ndarray:
    """(T, 3, 3) mass matrices of the linear nodal functions on triangles of the given areas (T,)."""
    return each(areas, (np.ones((1, 3, 3)) + np.eye(3)) / 12)


def two_components(elements: np.ndarray) -> np.ndarray:
    """(T, 2a, 2a): the same element matrices (T, a, a) for x and for y."""
    zero = np.zeros_like(elements)
    return np.block([[elements, zero], [zero, elements]])


class ElementSystem:
    """K x = b with some unknowns prescribed, K summed from element matrices.

    unknowns: (T, k) numbers of each element's unknowns; rank: (n,) sorting key of the unknowns in elimination order;
    held: (n,) True where the unknown is prescribed.
    """

    def __init__(self, unknowns: np.ndarray, rank: np.ndarray, held: np.ndarray):
        self.unknowns = unknowns
        self._ranked = np.argsort(rank, kind="stable")
        place = np.empty(len(rank), int)
        place[self._ranked] = np.arange(len(rank))
        rows, columns = (place[part] for part in _pairs(unknowns))
        keys, self._slot = np.unique(columns * len(rank) + rows, return_inverse=True)
        self._columns, self._rows = np.divmod(keys, len(rank))
        self._hold(held)

    def holding(self, held: np.ndarray) -> ElementSystem:
        """The same elements with other unknowns (n,) prescribed."""
        other = copy(self)
        other._hold(held)
        return other

    def _hold(self, held: np.ndarray) -> None:
        free = ~held[self._ranked]
        place = np.cumsum(free) - 1
        self.held, self.order, self.count = held, self._ranked[free], int(free.sum())
        kept = free[self._rows] & free[self._columns]
        self._kept = np.flatnonzero(kept)
        self.indices = place[self._rows[kept]].astype(np.int32)
        self.indptr = np.searchsorted(place[self._columns[kept]], np.arange(self.count + 1)).astype(np.int32)
        self._pattern = sp.csc_matrix((np.zeros(len(self.indices)), self.indices, self.indptr),
                                      shape=(self.count, self.count))
        self._pattern.has_canonical_format = True  # what is filled in is not looked through again

    def matrix(self, elements: np.ndarray) -> sp.csc_matrix:
        """K between the free unknowns, in elimination order, from element matrices (T, k, k)."""
        found = copy(self._pattern)
        found.data = np.bincount(self._slot, elements.ravel(), len(self._rows))[self._kept]
        return found

    def factored(self, elements: np.ndarray) -> Factored:
        """K from element matrices (T, k, k), factorised."""
        return Factored(self, elements, linear.factorised(self.matrix(elements)))

    def solve(self, elements: np.ndarray, right: np.ndarray, value: np.ndarray) -> np.ndarray:
        """x (n,) with the prescribed unknowns as in ``value`` (n,), for element matrices (T, k, k) and b (n,)."""
        return self.factored(elements).solve(right, value)


@dataclass(frozen=True, eq=False)
class Factored:
    """K of a system, from element matrices (T, k, k), with its factors."""

    system: ElementSystem
    elements: np.ndarray
    solver: linear.Solver

    def solve(self, right: np.ndarray, value: np.ndarray) -> np.ndarray:
        """x (n,) of K x = b (n,) with the prescribed unknowns as in ``value`` (n,)."""
        unknowns, order = self.system.unknowns, self.system.order
        known = np.where(self.system.held, value, 0.0)
        if known.any():
            moved = (self.elements @ known[unknowns][:, :, None])[:, :, 0]
            right = right - np.bincount(unknowns.ravel(), moved.ravel(), len(value))
        known[order] = self.solver.solve(right[order])
        return known


def _pairs(unknowns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Row and column unknown of every entry of element matrices (T, k, k), flattened."""
    k = unknowns.shape[1]
    return np.repeat(unknowns, k, axis=1).ravel(), np.tile(unknowns, (1, k)).ravel()


def saddle_blocks(upper, divergence, lower) -> np.ndarray:
    """(T, a + b, a + b) symmetric element matrices [[upper, -divergence^T], [-divergence, -lower]]."""
    a, b = upper.shape[1], lower.shape[1]
    elements = np.empty((len(upper), a + b, a + b))
    elements[:, :a, :a], elements[:, a:, a:] = upper, -lower
    elements[:, a:, :a] = -divergence
    elements[:, :a, a:] = -np.swapaxes(divergence, 1, 2)
    return elements


def saddle_system(velocity: np.ndarray, pressure: np.ndarray, held: np.ndarray,
                  order: np.ndarray | None = None) -> ElementSystem:
    """The system of two components on the same nodes and a pressure on other ones, pressures after their node.

    velocity: (T, a) nodes of each component; pressure: (T, b) nodes among the first ones of the velocity's;
    held: (n, 2) prescribed components; order: (n,) nodes in elimination order, if known. Unknowns are numbered x, then
    y, then pressure.
    """
    count = len(held)
    pressures = pressure.max() + 1
    place = np.empty(count)
    place[linear.node_order(count, velocity) if order is None else order] = np.arange(count)
    rank = np.concatenate([place, place, place[:pressures] + 0.5])
    unknowns = np.concatenate([velocity, count + velocity, 2 * count + pressure], axis=1)
    return ElementSystem(unknowns, rank, np.concatenate([held[:, 0], held[:, 1], np.zeros(pressures, bool)]))
