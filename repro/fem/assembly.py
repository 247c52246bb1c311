"""Assemble sparse systems from element matrices.

The sparsity, the elimination order and the position of every element entry in the sparse matrix
depend only on the connections of a mesh. They are computed once. As long as the connections stay
the same, an assembly is one summation.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np
import scipy.sparse as sp

from repro.fem import linear
from repro.fem.linear import DEFAULT, Method

#: One array, or one array for each kind of element.
Parts: TypeAlias = np.ndarray | tuple[np.ndarray, ...]


class ElementSystem:
    """System K x = b with prescribed unknowns; K is the sum of element matrices.

    unknowns: (T, k) numbers of each element's unknowns, or one array for each kind of
    element; rank: (n,) sorting key of the unknowns in elimination order; constrained: (n,) True
    where the unknown is prescribed. Methods take element matrices (T, k, k) for each kind.
    """

    def __init__(self, unknowns: Parts, rank: np.ndarray, constrained: np.ndarray,
                 method: Method = DEFAULT):
        self.kinds = _several(unknowns)
        self.method = method
        self._ranked = np.argsort(rank, kind="stable")
        place = np.empty(len(rank), np.int32)
        place[self._ranked] = np.arange(len(rank))
        rows, columns = (place[_flat(part)] for part in zip(*map(linear.pairs, self.kinds)))
        self._rows, self._columns, self._slot = _distinct(rows, columns, len(rank))
        ends = np.cumsum([part.shape[0] * part.shape[1] ** 2 for part in self.kinds])
        self._slots = np.split(self._slot, ends[:-1])
        self._constrain(constrained)

    def with_constrained(self, constrained: np.ndarray) -> ElementSystem:
        """The same elements with other unknowns (n,) prescribed."""
        other = copy(self)
        other._constrain(constrained)
        return other

    def _constrain(self, constrained: np.ndarray) -> None:
        free = ~constrained[self._ranked]
        place = np.cumsum(free) - 1
        self.constrained = constrained
        self.order = self._ranked[free]
        self.count = int(free.sum())
        self.free = ~constrained if constrained.any() else slice(None)
        inner = free[self._rows] & free[self._columns]
        self._entry_indices = np.flatnonzero(inner) if constrained.any() else slice(None)
        self.indices = place[self._rows[inner]].astype(np.int32)
        starts = np.searchsorted(place[self._columns[inner]], np.arange(self.count + 1))
        self.indptr = starts.astype(np.int32)
        self._pattern = sp.csc_matrix((np.zeros(len(self.indices)), self.indices, self.indptr),
                                      shape=(self.count, self.count))
        self._pattern.has_canonical_format = True  # avoids a check of every filled matrix

    def matrix(self, elements: Parts) -> sp.csc_matrix:
        """K between the free unknowns, in elimination order."""
        return self.filled(np.bincount(self._slot, _flat(_several(elements)), len(self._rows)))

    def entries(self, number: int, elements: np.ndarray) -> np.ndarray:
        """(d,) entries of K between all unknowns, column by column, from elements of one kind.

        number: index of the kind; elements: (T, k, k) its element matrices.
        """
        return np.bincount(self._slots[number], elements.ravel(), len(self._rows))

    def filled(self, entries: np.ndarray) -> sp.csc_matrix:
        """K between the free unknowns, from entries (d,) as :meth:`entries` returns them."""
        matrix = copy(self._pattern)
        matrix.data = entries[self._entry_indices]
        return matrix

    def product(self, elements: Parts, x: np.ndarray) -> np.ndarray:
        """(n,) K x for all unknowns x (n,)."""
        parts = [K @ x[unknowns][:, :, None]
                 for K, unknowns in zip(_several(elements), self.kinds, strict=True)]
        return self.assemble(tuple(parts))

    def assemble(self, loads: Parts) -> np.ndarray:
        """(n,) sums of the element loads (T, k) of all kinds."""
        return np.bincount(_flat(self.kinds), _flat(_several(loads)), len(self.constrained))

    def factored(self, elements: Parts) -> Factored:
        """Factorise K."""
        return Factored(self, elements, linear.factorised(self.matrix(elements), self.method))

    def solve(self, elements: Parts, right: np.ndarray,
              value: np.ndarray | None = None) -> np.ndarray:
        """x (n,) of K x = b (n,); prescribed unknowns are as in ``value`` (n,), zero by default."""
        return self.factored(elements).solve(right, value)


@dataclass(frozen=True, eq=False)
class Factored:
    """The matrix K of a system: its element matrices and its factors."""

    system: ElementSystem
    elements: Parts
    solver: linear.Solver

    def solve(self, right: np.ndarray, value: np.ndarray | None = None) -> np.ndarray:
        """x (n,) of K x = b (n,); prescribed unknowns are as in ``value`` (n,), zero by default."""
        order = self.system.order
        x = np.zeros(len(right))
        if value is not None and self.system.constrained.any():
            x = np.where(self.system.constrained, value, 0.0)
            right = right - self.system.product(self.elements, x)
        x[order] = self.solver.solve(right[order])
        return x


@dataclass(frozen=True, eq=False)
class Supported(Factored):
    """Factorised system with m more unknowns: multipliers s of the loads L.

    loads: (n, m) L; rows: (m,) numbers of prescribed unknowns whose rows must balance too. With
    B = K^-1 L, which takes one solution for each load, the solution is x - B s. The multipliers s
    follow from the balance of ``rows``.
    """

    loads: np.ndarray
    rows: np.ndarray

    @cached_property
    def _responses(self) -> np.ndarray:
        """(n, m) B."""
        return np.column_stack([super(Supported, self).solve(load) for load in self.loads.T])

    @cached_property
    def _per_multiple(self) -> np.ndarray:
        """(m, m) forces in ``rows`` (first axis) for each load with a multiplier of one."""
        forces = [load - self.system.product(self.elements, response)
                  for load, response in zip(self.loads.T, self._responses.T)]
        return np.column_stack(forces)[self.rows]

    def solve(self, right: np.ndarray, value: np.ndarray | None = None) -> np.ndarray:
        """x (n,) of K x + L s = b (n,), also in ``rows``. Prescribed unknowns are as in
        :meth:`Factored.solve`."""
        x = super().solve(right, value)
        unbalanced = right - self.system.product(self.elements, x)
        multiples = np.linalg.solve(self._per_multiple, unbalanced[self.rows])
        return x - self._responses @ multiples


def _distinct(rows: np.ndarray, columns: np.ndarray,
              count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows and columns (d,) of the distinct entries among m entries, sorted by column, then row.

    Also returns the number (m,) of the distinct entry to which each entry belongs.
    """
    order = _counting_sort(rows, count)
    order = order[_counting_sort(columns[order], count)]
    rows = rows[order]
    columns = columns[order]
    first = np.ones(len(order), bool)
    first[1:] = (rows[1:] != rows[:-1]) | (columns[1:] != columns[:-1])
    slot = np.empty(len(order), int)
    slot[order] = np.cumsum(first) - 1
    return rows[first], columns[first], slot


def _counting_sort(keys: np.ndarray, count: int) -> np.ndarray:
    """(m,) indices that sort keys (m,) from 0 to count - 1, stably and in linear time.

    The sort is SciPy's transposition of a sparse row. np.argsort takes twice as long.
    """
    ends = np.array([0, len(keys)], np.int32)
    entries = np.arange(len(keys), dtype=np.int32)
    return sp.csr_matrix((entries, keys, ends), shape=(1, count)).tocsc().data


def _several(parts: Parts) -> tuple[np.ndarray, ...]:
    """Arrays as a tuple, one for each kind of element."""
    return parts if isinstance(parts, tuple) else (parts,)


def _flat(parts: Sequence[np.ndarray]) -> np.ndarray:
    """Concatenate the flattened arrays."""
    return parts[0].ravel() if len(parts) == 1 else np.concatenate([part.ravel() for part in parts])


def saddle_blocks(upper: np.ndarray, divergence: np.ndarray,
                  lower: np.ndarray | None = None) -> np.ndarray:
    """(T, a + b, a + b) symmetric element matrices [[upper, -divergence^T], [-divergence, -lower]].

    upper: (T, a, a), or (T, a / 2, a / 2) for each of two components that are not coupled;
    divergence: (T, b, a); lower: (T, b, b), zero by default.
    """
    count, b, a = divergence.shape
    k = upper.shape[1]
    elements = np.zeros((count, a + b, a + b))
    for first in range(0, a, k):
        elements[:, first: first + k, first: first + k] = upper
    elements[:, a:, :a] = -divergence
    elements[:, :a, a:] = -np.swapaxes(divergence, 1, 2)
    if lower is not None:
        elements[:, a:, a:] = -lower
    return elements


def saddle_system(velocity: np.ndarray, pressure: np.ndarray, constrained: np.ndarray,
                  order: np.ndarray | None = None, method: Method = DEFAULT,
                  doubled: np.ndarray | None = None) -> ElementSystem:
    """Build the system of a velocity at all nodes and a pressure at some of them.

    velocity: (T, a) nodes of each component; pressure: (T, b) numbers of the pressures. The first
    pressures belong to the first nodes of the velocity. The last ones are second pressures at the
    nodes ``doubled`` (d,), if any; constrained: (n, 2) prescribed components; order: (n,) nodes in
    elimination order, if known. Unknowns are numbered x, then y, then pressure. Each pressure is
    eliminated after the components at its node.
    """
    count = len(constrained)
    pressures = pressure.max() + 1
    place = np.empty(count)
    place[linear.node_order(count, velocity) if order is None else order] = np.arange(count)
    nodes = np.arange(pressures)
    if doubled is not None:
        nodes[pressures - len(doubled):] = doubled
    rank = np.concatenate([place, place, place[nodes] + 0.5])
    unknowns = np.concatenate([velocity, count + velocity, 2 * count + pressure], axis=1)
    both = np.concatenate([constrained[:, 0], constrained[:, 1], np.zeros(pressures, bool)])
    return ElementSystem(unknowns, rank, both, method)
