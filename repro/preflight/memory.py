"""Estimate the memory of a run, and read the free memory.

The number of nodes is the integral of the inverse area per node, (sqrt(3) / 2) h^2, over the meshed
part. At a distance d from the aggregate's surface the size h is s + g d, up to the largest L (3.1):

    nodes = A / (sqrt(3)/2 L^2) + 2 l / (sqrt(3)/2) ((1/s - 1/L) / g - (L - s) / (g L^2))

with the area A of the meshed part and the length l of the surface; it is right within a third. For
an outline the second term is a sum over pieces of its edges, each with its own size; it is right
within a factor of two.
"""

import math
import os
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import chain, combinations
from pathlib import Path

import numpy as np
import shapely

from repro.errors import MeshError
from repro.fem import sizing
from repro.fem.outline import Outline
from repro.fem.sizing import ACROSS_AGGREGATE, ACROSS_PORE, SPLIT
from repro.model.advice import with_advice
from repro.model.meshing import (
    initial_outlines,
    resolution,
    sized,
    thin_layers,
)
from repro.scene import Aggregate, Scene, SceneError
from repro.scene.rules import FINEST

#: Bytes per node at the peak of a run, measured at 800 to 50 000 nodes.
PER_NODE = 25e3
#: Bytes of a run that do not depend on its mesh.
LEAST = 30e6
#: The largest mesh of a run over its first one. Of 100 pores of verification/problems/family.py,
#: in coarse runs past contact, it is at most 5.1. A longer pore may need more.
GROWTH = 5.1
#: Pieces of each edge of an outline, each with its own size.
PIECES = 16
#: A run that needs more than this part of the free memory causes a warning.
WARNED = 0.5
#: Factors of a refinement that are tried for a run that does not fit. Coarser meshes resolve
#: little.
COARSER = (0.7, 0.5, 0.35, 0.25)
MB = 1e6


def expected_nodes(scene: Scene) -> float:
    """Estimate the nodes of the largest mesh, including midside nodes. It generates no mesh."""
    return first_nodes(scene) * (GROWTH if scene.growth and scene.growth.end else 1.0)


def first_nodes(scene: Scene) -> float:
    """Estimated nodes of the mesh at t = 0: around half-discs and outlines, or of a channel."""
    if not scene.aggregates:
        return _nodes(scene, 3 * scene.pore.whole_width, [])
    firsts, lasts, surface = zip(*map(partial(_around, scene), scene.aggregates,
                                      initial_outlines(scene)))
    return _nodes(scene, max(lasts) - min(firsts), list(chain(*surface)))


def _around(scene: Scene, seed: Aggregate,
            outline: Outline) -> tuple[float, float, list[tuple[float, float]]]:
    """Ends (um) of a mesh around a seed, if the pore were endless; element size and length (um) of
    each piece of its surface."""
    margin = min(10 * seed.height(scene.pore.width), 1.5 * scene.pore.whole_width)
    if seed.radius is None:
        pieces = _edges(outline.corners, sized(scene))
        return outline.upstream - margin, outline.downstream + margin, pieces
    size = seed.radius / ACROSS_AGGREGATE / resolution(scene)
    reach = seed.radius + margin
    return seed.position - reach, seed.position + reach, [(size, math.pi * seed.radius)]


def _edges(outline: Outline, sizes: sizing.Sizing) -> list[tuple[float, float]]:
    """Element size and length (um) of each piece of the interface."""
    count = len(outline.points)
    edge = np.repeat(np.arange(count), PIECES)
    pieces = sizing.placed(outline, edge, np.tile(np.arange(PIECES) / PIECES, count))
    near = np.minimum(sizing.interface_sizes(pieces, sizes), SPLIT * outline.edge_lengths()[edge])
    graded = sizing.graded_size(pieces.points, *sizing.size_sources(outline, sizes), sizes)
    near = np.minimum(near, graded)
    on_interface = outline.interface_edges()[edge]
    return [*zip(near[on_interface], pieces.edge_lengths()[on_interface])]


def _nodes(scene: Scene, extent: float, surface: list[tuple[float, float]]) -> float:
    """Nodes of a mesh with a length (um).

    surface: element size and length (um) of each piece of the aggregates' surface.
    """
    pore = scene.pore
    numerics = scene.numerics
    length = pore.length if numerics.whole_pore else min(pore.length, extent)
    largest = pore.width / ACROSS_PORE / resolution(scene)
    if numerics.gradation == 0:
        largest = min([largest, *(size for size, _ in surface)])
    hexagon = math.sqrt(3) / 2  # the area of a node, over h^2
    corners = length * pore.width / (hexagon * largest**2) + 2 * (length + pore.width) / largest
    for near, piece in surface:  # smaller elements on both sides of the surface
        if near < largest:
            thickness = (largest - near) / numerics.gradation
            corners += 2 * piece / hexagon * ((1 / near - 1 / largest) / numerics.gradation
                                              - thickness / largest**2)
    return float(corners) * numerics.scheme.order**2


def expected_bytes(scene: Scene, growth: float | None = None) -> float:
    """Estimated memory (bytes) of a run without the program.

    growth: of the nodes, the largest mesh over the first one; None if it is unknown.
    """
    nodes = expected_nodes(scene) if growth is None else growth * first_nodes(scene)
    return LEAST + PER_NODE * nodes


def require_outline(scene: Scene) -> None:
    """Raise SceneError if no mesh resolves the boundary layers, or if the curve through the points
    of an outline crosses itself, leaves the pore or comes close to another aggregate; rules of the
    scene check the points."""
    try:
        resolution(scene)
        curves = {place: shapely.Polygon(outline.corners.points)
                  for place, outline in zip(scene.aggregate_keys, initial_outlines(scene))}
    except MeshError as error:
        raise SceneError(f"{scene.name}: {with_advice(error)}") from error
    for place, curve in curves.items():
        if not curve.is_valid:
            location = shapely.is_valid_reason(curve)
            raise SceneError(f"{scene.name}: the spline through the points of {place}.outline "
                             f"crosses itself ({location}); try smooth = false")
    for one, other in combinations(curves, 2):
        if curves[one].distance(curves[other]) < FINEST * scene.pore.width:
            raise SceneError(f"{scene.name}: the splines of {one} and {other} overlap or touch; "
                             "try smooth = false")


def require_memory(scene: Scene, warn: Callable[[str], None]) -> None:
    """Warn if a run may need more than half of the free memory.

    Raises SceneError if it needs more than the free memory.
    """
    free = free_bytes()
    expected = expected_bytes(scene)
    need = (f"about {_count(expected / MB)} MB of memory are needed "
            f"({_count(expected_nodes(scene))} nodes), {free / MB:.0f} MB are free")
    if expected > free:
        raise SceneError(f"{scene.name}: {need}; {_fitting(scene, free)}")
    if expected > WARNED * free:
        warn(f"{scene.name}: {need}")


def _count(number: float) -> str:
    """Write a number as an integer, or with an exponent if it has more than nine digits."""
    return f"{number:.0f}" if number < 1e9 else f"{number:.1e}"


def _fitting(scene: Scene, free: float) -> str:
    """Name the largest tried refinement that fits into the free memory (bytes), or the keys that
    make the boundary layers too thin for any."""
    if resolution(scene) > scene.numerics.refinement:
        return ("no numerics.refinement that resolves the boundary layers fits: "
                f"{thin_layers(scene)}")
    for factor in COARSER:
        refinement = float(f"{scene.numerics.refinement * factor:.2g}")
        coarser = replace(scene, numerics=replace(scene.numerics, refinement=refinement))
        if expected_bytes(coarser) <= WARNED * free:
            return f"numerics.refinement = {refinement:g} needs at most half of them"
    return "no numerics.refinement that resolves the pore fits"


def free_bytes(root: Path = Path("/")) -> float:
    """Memory (bytes) that this process may still allocate.

    It is the least of the free memory of the system, without swapping, and the remainders of the
    control groups and of the address space of the process; infinite if unknown.
    """
    available = [1024.0 * int(line.split()[1]) for line in _lines(root / "proc/meminfo")
                 if line.startswith("MemAvailable:")]
    return max(0.0, min([*available, *_groups(root), _address_space(root)]))


def _groups(root: Path) -> Iterator[float]:
    """Remaining memory of each control group of this process, of either version."""
    for line in _lines(root / "proc/self/cgroup"):
        _, controllers, path = line.split(":", 2)
        if controllers in ("", "memory"):
            base = root / "sys/fs/cgroup" / controllers
            group = base / path.lstrip("/")
            inside = [group, *group.parents]
            yield from map(_remaining, inside[: inside.index(base) + 1])


def _remaining(group: Path) -> float:
    """Remaining memory (bytes) of a control group; cached files count as free."""
    for limit, used, reclaimable in (("memory.max", "memory.current", "inactive_file"),
                                   ("memory.limit_in_bytes", "memory.usage_in_bytes",
                                    "total_inactive_file")):
        with suppress(OSError, ValueError):
            most = float((group / limit).read_text())  # "max" is none
            statistics = dict(line.split() for line in _lines(group / "memory.stat"))
            return most - float((group / used).read_text()) + float(statistics.get(reclaimable, 0))
    return math.inf


def _address_space(root: Path) -> float:
    """Remaining address space under ``ulimit -v``."""
    with suppress(ImportError, OSError, ValueError, IndexError):
        import resource

        limit = resource.getrlimit(resource.RLIMIT_AS)[0]
        if limit != resource.RLIM_INFINITY:
            pages = int(_lines(root / "proc/self/statm")[0].split()[0])
            return float(limit - pages * os.sysconf("SC_PAGE_SIZE"))
    return math.inf


def _lines(path: Path) -> list[str]:
    """The lines of a file of the system; empty if it does not exist."""
    try:
        return path.read_text().splitlines()
    except OSError:
        return []
