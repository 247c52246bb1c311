"""Estimate the memory of a run, and read the free memory.

The number of nodes is the integral of the inverse area per node, (sqrt(3) / 2) h^2, over the meshed
part. At a distance d from the aggregate's surface the size h is s + g d, up to the largest L (3.1):

    nodes = A / (sqrt(3)/2 L^2) + 2 l / (sqrt(3)/2) ((1/s - 1/L) / g - (L - s) / (g L^2))

with the area A of the meshed part and the length l of the surface; it is right within a third. For
an outline the second term is a sum over pieces of its edges, each with its own size; it is right
within a factor of two.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import shapely

from repro.errors import MeshError
from repro.fem import sizing
from repro.fem.outline import Outline
from repro.fem.sizing import ACROSS_AGGREGATE, ACROSS_PORE, SPLIT
from repro.model.advice import with_advice
from repro.model.meshing import (
    initial_outline,
    resolution,
    sized,
    thin_layers,
    whole_width_of,
)
from repro.scene import Scene, SceneError, needed

#: Bytes per node at the peak of a run, measured at 800 to 50 000 nodes.
PER_NODE = 25e3
#: Bytes of a run that do not depend on its mesh.
LEAST = 30e6
#: Nodes of six-node triangles per corner.
PER_CORNER = 4.0
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
HEXAGON = math.sqrt(3) / 2
MB = 1e6


def expected_nodes(scene: Scene) -> float:
    """Estimate the nodes of the largest mesh, including midside nodes. It generates no mesh."""
    return first_nodes(scene) * (GROWTH if scene.growth and scene.growth.end else 1.0)


def first_nodes(scene: Scene) -> float:
    """Estimated nodes of the mesh at t = 0: around a half-disc or an outline, or of a channel."""
    if scene.aggregate is None:
        return _nodes(scene, 0.0, 3 * whole_width_of(scene), [])
    radius = scene.aggregate.radius
    if radius is not None:
        return _half_disc_nodes(scene, radius, radius)
    outline = needed(initial_outline(scene), "an aggregate")
    extent = outline.downstream - outline.upstream
    return _nodes(scene, outline.thickness, extent, _edges(outline.corners, sized(scene)))


def _half_disc_nodes(scene: Scene, thickness: float, reach: float) -> float:
    """Nodes of a mesh around an aggregate with a thickness and a half length (um)."""
    size = thickness / ACROSS_AGGREGATE / resolution(scene)
    return _nodes(scene, thickness, 2 * reach, [(size, math.pi * min(thickness, reach))])


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


def _nodes(scene: Scene, thickness: float, extent: float,
           surface: list[tuple[float, float]]) -> float:
    """Nodes of a mesh around an aggregate with a thickness and a length (um).

    surface: element size and length (um) of each piece of its surface.
    """
    pore = scene.pore
    numerics = scene.numerics
    margin = min(10 * thickness, 1.5 * whole_width_of(scene))
    length = pore.length if numerics.whole_pore else min(pore.length, extent + 2 * margin)
    largest = pore.width / ACROSS_PORE / resolution(scene)
    if numerics.gradation == 0:
        largest = min([largest, *(size for size, _ in surface)])
    corners = length * pore.width / (HEXAGON * largest**2) + 2 * (length + pore.width) / largest
    corners += sum(_graded(piece, near, largest, numerics.gradation) for near, piece in surface)
    return float(corners) * (PER_CORNER if numerics.scheme.order == 2 else 1.0)


def _graded(surface: float, near: float, largest: float, gradation: float) -> float:
    """Additional nodes due to smaller elements on both sides of a surface (um)."""
    if near >= largest:
        return 0.0
    thickness = (largest - near) / gradation
    return 2 * surface / HEXAGON * ((1 / near - 1 / largest) / gradation - thickness / largest**2)


def expected_bytes(scene: Scene, growth: float | None = None) -> float:
    """Estimated memory (bytes) of a run without the program.

    growth: of the nodes, the largest mesh over the first one; None if it is unknown.
    """
    nodes = expected_nodes(scene) if growth is None else growth * first_nodes(scene)
    return LEAST + PER_NODE * nodes


def require_outline(scene: Scene) -> None:
    """Raise SceneError if no mesh resolves the boundary layers, or if the curve through the points
    of an outline crosses itself or leaves the pore; rules of the scene check the points."""
    try:
        resolution(scene)
        outline = initial_outline(scene)
        curve = None if outline is None else shapely.Polygon(outline.corners.points)
    except MeshError as error:
        raise SceneError(f"{scene.name}: {with_advice(error)}") from error
    if curve is not None and not curve.is_valid:
        location = shapely.is_valid_reason(curve)
        raise SceneError(f"{scene.name}: the spline through the points of aggregate.outline "
                         f"crosses itself ({location}); try smooth = false")


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

    It is the least of the free memory of the system and the remainders of the control groups and of
    the address space of the process; infinite if unknown.
    """
    limits = [_available(root), *_groups(root), _address_space(root)]
    return max(0.0, min(limits))


def _available(root: Path) -> float:
    """Free memory of the system, without swapping."""
    for line in _lines(root / "proc/meminfo"):
        if line.startswith("MemAvailable:"):
            return 1024.0 * int(line.split()[1])
    return math.inf


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
