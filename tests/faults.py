"""Faults that tests inject by name: absent or replaced packages, and a limit on memory."""
import sys
import tracemalloc
from contextlib import contextmanager
from types import SimpleNamespace

import scipy.sparse as sp
from scipy.sparse.linalg import splu

from repro import results


@contextmanager
def limit_memory(most):
    """Fail if the peak memory of the block exceeds ``most`` bytes."""
    tracemalloc.start()
    yield
    assert tracemalloc.get_traced_memory()[1] < most
    tracemalloc.stop()


def remove_package(monkeypatch, name):
    """Make the import of a package fail as if it were not installed."""
    monkeypatch.setitem(sys.modules, name, None)


def replace_version(monkeypatch, name):
    """Make a package report version 0.0."""
    installed = results.version
    monkeypatch.setattr(results, "version", lambda package: "0.0" if package == name else installed(package))


def replace_package(monkeypatch, name):
    """Replace the optional package pypardiso by SciPy, which factors with reordered columns and partial pivoting."""
    module = _factoring()
    monkeypatch.setitem(sys.modules, name, module)
    return module


def _factoring():
    matrix_types = []

    class PyPardisoSolver:
        def __init__(self, mtype):
            matrix_types.append(mtype)
            self.factor = None

        def factorize(self, matrix):
            self.factor = splu(sp.csc_matrix(matrix))

        def solve(self, matrix, right):
            return self.factor.solve(right)

        def free_memory(self, everything):
            self.factor = None

    return SimpleNamespace(PyPardisoSolver=PyPardisoSolver, calls=matrix_types)
