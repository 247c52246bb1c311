"""Drawings of the geometry of cases: ``python -m verification.evidence.first_mesh FOLDER``.

A case states its geometry in code. Its first variant therefore runs until it makes functions on a mesh, and stops
there. This mesh is drawn. A case without a mesh, or without one after LONGEST, has no drawing.
"""

import io
import signal
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path

import pytest
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from PIL import Image

from repro.fem.mesh import Mesh
from repro.fem.space import Space
from verification.evidence.cases import Case, cases
from verification.evidence.writing import ROOT

#: Time (s) that a case has to make its mesh. Most need a hundredth of it; two compute a reference first.
LONGEST = 10.0
#: Fluid and aggregates.
COLOURS = ("#dcebf5", "#b98a56")
#: Colours of a picture, which keep its file small.
FEW = 16
#: The nodes of a triangle around it, for straight and for curved sides.
AROUND = {1: (0, 1, 2), 2: (0, 3, 1, 4, 2, 5)}
#: Size (in) of a drawing: its width, the limits of its height, and the additional height of the labels.
WIDTH, LOWEST, HIGHEST, LABELS = 7.0, 0.5, 4.0, 0.8


class Stop(BaseException):
    """The end of a case that needs no more time. No ``except Exception`` catches it."""


class FirstMeshes:
    """The plugin of pytest that stops cases at their first mesh. ``meshes`` are {case: mesh}."""

    def __init__(self) -> None:
        self.meshes: dict[str, Mesh] = {}
        self.case = ""

    def pytest_sessionstart(self) -> None:
        """Observe the meshes, and the functions on them, that a case makes."""
        signal.signal(signal.SIGALRM, self._stop)
        patch = pytest.MonkeyPatch()
        patch.setattr(Mesh, "__init__", _followed(Mesh.__init__, lambda mesh: self.meshes.setdefault(self.case, mesh)))
        patch.setattr(Space, "__init__", _followed(Space.__init__, lambda space: self._take(space.mesh)))

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_pyfunc_call(self, pyfuncitem: pytest.Function):
        """Run a case until it makes functions on a mesh, or until its time is over. Its verdict does not matter."""
        self.case = dict(pyfuncitem.user_properties)["case"]
        signal.setitimer(signal.ITIMER_REAL, LONGEST)
        try:
            yield
        except (Stop, Exception, pytest.fail.Exception):
            pass
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0)
        return True

    def _take(self, mesh: Mesh) -> None:
        self.meshes[self.case] = mesh
        self._stop()

    def _stop(self, *signalled: object) -> None:
        raise Stop


def _followed(make, call):
    """A constructor that calls a function with the new object."""
    def followed(self, *arguments, **named):
        make(self, *arguments, **named)
        call(self)
    return followed


def first_meshes(chosen: Iterable[Case]) -> dict[str, Mesh]:
    """{case: its first mesh}; cases that make none are left out."""
    plugin = FirstMeshes()
    tests = [str(ROOT / _first_test(case)) for case in chosen]
    status = pytest.main(["-n0", "-q", "--no-summary", "-p", "no:cacheprovider", f"--rootdir={ROOT}", *tests], [plugin])
    if status:
        raise RuntimeError(f"pytest ended with status {status}")
    return {id: mesh for id, mesh in plugin.meshes.items() if id}


def _first_test(case: Case) -> str:
    """The test of the first quick variant, or of the first one."""
    quick = [label for label in case.variants if label not in case.slow_variants]
    return case.variants[[*quick, *case.variants][0]]


def draw(mesh: Mesh, target: Path) -> None:
    """Write a drawing of a mesh: triangles of the fluid and of the aggregates, in um."""
    (left, low), (right, high) = mesh.points.min(axis=0), mesh.points.max(axis=0)
    height = min(max(LOWEST, WIDTH * (high - low) / (right - left)), HIGHEST)
    figure = Figure(figsize=(WIDTH, height + LABELS), dpi=100)
    axis = figure.add_axes((0.09, 0.7 * LABELS / (height + LABELS), 0.88, height / (height + LABELS)))
    colours = [COLOURS[is_biomass] for is_biomass in mesh.biomass.astype(int)]
    triangles = mesh.points[mesh.cells[:, AROUND[mesh.geometry]]]
    axis.add_collection(PolyCollection(triangles, facecolors=colours, edgecolors="#5a6a75", linewidths=0.3))
    axis.set(xlim=(left, right), ylim=(low, high), aspect="equal", xlabel="x (um)", ylabel="y (um)")
    with io.BytesIO() as picture:
        figure.savefig(picture)
        Image.open(picture).convert("RGB").quantize(FEW).save(target, optimize=True)


def write(folder: Path, chosen: Mapping[str, Case]) -> None:
    """Write FOLDER/CASE.png of the cases that make a mesh."""
    folder.mkdir(parents=True, exist_ok=True)
    for id, mesh in first_meshes(chosen.values()).items():
        draw(mesh, folder / f"{id}.png")


if __name__ == "__main__":
    write(Path(sys.argv[1]), {id: case for id, case in cases().items() if id in sys.argv[2:] or not sys.argv[2:]})
