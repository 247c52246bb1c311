"""C19: how far from the aggregate the pore must be meshed (3.1).

What is cut off is a matter of the equations and not of the elements, so the converged solution judges it. The meshes
are nested: a core around the aggregate, and beyond it columns of triangles, of which those of a shorter mesh are a part
of the longer one's. What two of them differ by is what the missing columns do; two unrelated meshes differ by more.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from repro.fem import mesher
from repro.fem.mesh import Mesh, curved
from repro.fem.outline import half_disc as seed
from repro.fem.sizing import ACROSS_AGGREGATE
from repro.model.pore import sized
from verification.claims import Finding, at_most, claim
from verification.claims.runs import BASE, scene
from verification.claims.states import full_biomass, solution

RADII, PARTS = (5.0, 10.0, 20.0, 30.0), (0.25, 0.5, 1.0, 1.5)


@claim("C19", "3.1", "meshing to min(5 R, 1 W) from the aggregate suffices")
def truncation() -> Finding:
    """Conductivity and effluents of half-discs of X_m meshed to parts of min(5 R, W), against the whole pore meshed, on
    nested meshes."""
    said = scene(*BASE)
    errors = {radius: _errors(said, radius) for radius in RADII}
    checks = tuple(at_most(f"largest error at min(5 R, W), R = {radius:g} um (%)", "suffices",
                           found[PARTS.index(1.0)].max(), 0.5, "0.5 %: as little as the time step is to matter")
                   for radius, found in errors.items())
    told = "; ".join(f"R = {radius:g} um: " + ", ".join(f"{part:g}: {'/'.join(f'{e:.2g}' for e in row)}"
                                                         for part, row in zip(PARTS, found))
                     for radius, found in errors.items())
    return Finding(checks, reason="what is cut off matters by more than that",
                   note="Errors (%) of conductivity/acceptor effluent/donor effluent at parts of min(5 R, W): "
                   f"{told}. In the scheme of 2001 meshing all of the pore adds the error of linear elements in its "
                   "clean part, which is no truncation; that is its range.")


def _errors(said, radius: float) -> np.ndarray:
    """(parts, 3) errors in percent at each distance."""
    reaches = [part * min(5 * radius, said.pore.width) for part in PARTS]
    values = np.array([_numbers(said, grid) for grid in nested(said, radius, reaches)])
    return 100 * np.abs(values[:-1] / values[-1] - 1)


def _numbers(said, grid: Mesh) -> list[float]:
    """Conductivity and both effluents."""
    found = solution(said, grid, full_biomass(said, grid))
    return [found.flow.conductivity, *(flux.effluent for flux in found.fluxes)]


def nested(said, radius: float, reaches: list[float]) -> list[Mesh]:
    """Meshes around a half-disc to ascending distances (um) from it, and to the pore's ends, each part of the next."""
    numerics = said.numerics
    sizes = sized(said)
    ends = [radius + reach for reach in reaches]
    first = seed(radius, ACROSS_AGGREGATE * numerics.refinement, numerics.geometry)
    core, outline = mesher.generate(first, (-ends[0], ends[0]), sizes, numerics.geometry)
    meshes = [core.straight]
    for end in (*ends[1:], said.pore.length / 2):
        meshes.append(lengthened(meshes[-1], end, sizes.largest))
    return meshes if numerics.geometry == 1 else [curved(each, outline.points[1::2]) for each in meshes]


def lengthened(mesh: Mesh, end: float, size: float) -> Mesh:
    """A straight mesh with columns of triangles of a length (um) at most beyond both ends, to -end and end."""
    for line, start in zip((mesh.topology.inlet, mesh.topology.outlet), mesh.ends):
        places = np.linspace(start, np.copysign(end, start), 1 + int(np.ceil((end - abs(start)) / size)))
        mesh = _with_columns(mesh, line, places[1:])
    return Mesh.of(mesh.points, mesh.cells, mesh.biomass, mesh.loop, mesh.width, (-end, end))


def _with_columns(mesh: Mesh, line: np.ndarray, places: np.ndarray) -> Mesh:
    """With columns from a line of nodes to each of the places x in turn. No triangle has an edge on an end and one on a
    wall: diagonals run from the outer node nearer to the middle of the pore."""
    y = mesh.points[line, 1]
    new = np.column_stack([np.repeat(places, len(line)), np.tile(y, len(places))])
    numbers = len(mesh.points) + np.arange(len(new)).reshape(len(places), len(line))
    columns = np.vstack([line, numbers])
    near, far = columns[:-1], columns[1:]
    a, d = near[:, :-1].ravel(), near[:, 1:].ravel()
    b, c = far[:, :-1].ravel(), far[:, 1:].ravel()
    low = np.tile(y[:-1] + y[1:] < mesh.width, len(places))
    cells = np.hstack([np.where(low, [a, b, d], [a, b, c]), np.where(low, [b, c, d], [a, c, d])]).T
    if places[0] < mesh.points[line[0], 0]:
        cells = cells[:, ::-1]
    topology = replace(mesh.topology, cells=np.vstack([mesh.cells, cells]),
                       biomass=np.append(mesh.biomass, np.zeros(len(cells), bool)))
    return replace(mesh, points=np.vstack([mesh.points, new]), topology=topology)
