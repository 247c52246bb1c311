"""Faults that tests inject, by their names: what is absent or stands in for something else, put back afterwards."""
import sys
import tracemalloc
from contextlib import contextmanager
from types import SimpleNamespace

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import reverse_cuthill_mckee
from scipy.sparse.linalg import splu

from repro import results


@contextmanager
def little_memory(most):
    """Fails where it takes more bytes than so many."""
    tracemalloc.start()
    yield
    assert tracemalloc.get_traced_memory()[1] < most
    tracemalloc.stop()


def absent_package(monkeypatch, name):
    """Importing a package fails as where it is not installed."""
    monkeypatch.setitem(sys.modules, name, None)


def another_version(monkeypatch, name):
    """A package says that it is of version 0.0."""
    known = results.version
    monkeypatch.setattr(results, "version", lambda asked: "0.0" if asked == name else known(asked))


def stand_in_package(monkeypatch, name):
    """A package's few functions that are used, made of what is installed: "pymetis", which orders nodes, by reverse
    Cuthill-McKee; "pypardiso", which factors, with columns ordered anew and partial pivoting."""
    made = {"pymetis": _ordering, "pypardiso": _factoring}[name]()
    monkeypatch.setitem(sys.modules, name, made)
    return made


def _ordering():
    calls = []

    def nested_dissection(graph):
        calls.append(graph)
        count = len(graph.indptr) - 1
        matrix = sp.csr_array((np.ones(len(graph.indices)), graph.indices, graph.indptr), shape=(count, count))
        order = reverse_cuthill_mckee(matrix, symmetric_mode=True)
        return order.tolist(), np.argsort(order).tolist()

    def adjacency(indptr, indices):
        return SimpleNamespace(indptr=indptr, indices=indices)

    return SimpleNamespace(nested_dissection=nested_dissection, CSRAdjacency=adjacency, calls=calls)


def _factoring():
    made = []

    class PyPardisoSolver:
        def __init__(self, mtype):
            made.append(mtype)
            self.factor = None

        def factorize(self, matrix):
            self.factor = splu(sp.csc_matrix(matrix))

        def solve(self, matrix, right):
            return self.factor.solve(right)

        def free_memory(self, everything):
            self.factor = None

    return SimpleNamespace(PyPardisoSolver=PyPardisoSolver, calls=made)
