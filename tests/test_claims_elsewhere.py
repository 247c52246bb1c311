"""Verdicts on other machines: other kernels of the linear algebra, threads, coordinates, and versions of Python."""
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from numpy._core._multiarray_umath import __cpu_features__ as features

from tests import again
from verification.claims import HOLDS, report

ROOT = Path(__file__).parents[1]
#: Kernels of OpenBLAS, what they need of the processor, and with how many threads and which coordinates each runs.
KERNELS = [("Nehalem", "SSE42", "1", 1.0), ("Haswell", "AVX2", "2", 1 + 1e-12),
           ("SkylakeX", "AVX512_SKX", "1", 1 - 1e-12)]
#: What a Python needs for `tests.again`.
NEEDED = "import numpy, scipy, skfem, shapely, mmgpy, meshio"


def computed(python=sys.executable, factor=1.0, threads="1", **environment):
    """What `tests.again` prints in a process of its own."""
    names = {"OMP_NUM_THREADS": threads, "OPENBLAS_NUM_THREADS": threads, "PYTHONPATH": str(ROOT), **environment}
    told = subprocess.run([python, "-m", "tests.again", repr(factor)], env={**os.environ, **names}, cwd=ROOT,
                          capture_output=True, text=True, timeout=300)
    assert told.returncode == 0, told.stderr
    return json.loads(told.stdout)


def differing(found):
    """Numbers outside of their recorded intervals, and outcomes that are not the recorded ones."""
    known = {each["id"]: each["checks"] for each in report.read()}
    return [(id, quantity, value) for id, rows in found.items()
            for (quantity, value, holds), one in zip(rows, known[id], strict=True)
            if not report.inside(value, one["low"], one["high"]) or holds != (one["outcome"] == HOLDS)]


@pytest.mark.parametrize("kernel, feature, threads, factor", [
    KERNELS[0], *(pytest.param(*row, marks=pytest.mark.thorough) for row in KERNELS[1:])],
    ids=[row[0] for row in KERNELS])
def test_other_kernels_threads_and_coordinates_change_no_verdict(kernel, feature, threads, factor):
    """In a process of its own each."""
    if not features.get(feature):
        pytest.skip(f"this processor lacks {feature}")
    found = computed(factor=factor, threads=threads, OPENBLAS_CORETYPE=kernel)
    assert found.pop("kernel") == kernel
    assert set(found) == set(again.QUICK) and differing(found) == []


def has_what_it_takes(python):
    """Is there such a Python, with the packages?"""
    return python is not None and subprocess.run([python, "-c", NEEDED], capture_output=True).returncode == 0


@pytest.mark.parametrize("version", ["3.11", "3.12", "3.13"])
def test_other_versions_of_python_change_no_verdict(version):
    """Of those on the PATH that have the packages; the one that runs the tests is judged with every kernel."""
    if version == f"3.{sys.version_info.minor}":
        pytest.skip("it runs these tests")
    python = shutil.which(f"python{version}")
    if not has_what_it_takes(python):
        pytest.skip(f"no python{version} with numpy, scipy, scikit-fem, shapely, mmgpy and meshio is on the PATH")
    found = computed(python)
    found.pop("kernel")
    assert set(found) == set(again.QUICK) and differing(found) == []


def test_a_number_outside_of_its_interval_is_seen():
    rows = [(check["quantity"], check["value"], check["outcome"] == HOLDS) for check in _checks("C03")]
    assert differing({"C03": rows}) == []
    (quantity, value, holds), other = rows
    assert differing({"C03": [(quantity, 1.002 * value, holds), other]}) == [("C03", quantity, 1.002 * value)]
    assert differing({"C03": [(quantity, value, not holds), other]}) == [("C03", quantity, value)]


def _checks(id):
    return next(each["checks"] for each in report.read() if each["id"] == id)
