"""The fields of a curved mesh for meshio: triangles with six nodes; as :func:`repro.results.fields`."""

from __future__ import annotations

import meshio
import numpy as np

from repro.curved import elements
from repro.curved import growth as mechanics
from repro.curved.pore import active_biomass
from repro.model import growth

M_PER_D, CM = 24e-6, 1e-4


def fields(scene, pore, solved) -> meshio.Mesh:
    """One value a node, or a mean over a triangle, named with their units."""
    grid = pore.mesh
    points, cells = {}, {"region": grid.biomass.astype(float)}
    if solved.flow:
        points["velocity_m_per_d"] = _three(M_PER_D * solved.flow.velocity)
        points["head_cm"] = CM * grid.with_middles(solved.flow.head)
    if solved.concentrations:
        points["acceptor_mg_per_L"] = solved.concentrations.acceptor
        points["donor_mg_per_L"] = solved.concentrations.donor
    if scene.kinetics:
        active = active_biomass(scene, pore) / scene.kinetics.maximum_density
        body = np.isin(np.arange(len(active)), grid.body)
        points["active_biomass"], points["inert_biomass"] = active, np.where(body, 1 - active, 0.0)
    if scene.growth:
        _add_mechanics(scene, pore, points, cells)
    return meshio.Mesh(_three(grid.points), [("triangle6", grid.cells)], point_data=points,
                       cell_data={name: [value] for name, value in cells.items()})


def _add_mechanics(scene, pore, points: dict, cells: dict) -> None:
    grid, modulus = pore.mesh, scene.growth.shear_modulus
    body = np.isin(np.arange(len(grid.points)), grid.body)
    origin = np.where(body[:, None], pore.origin, grid.points)
    points["displacement_um"], points["position_t0_um"] = _three(grid.points - origin), _three(origin)
    points["pressure_MPa"] = modulus * grid.with_middles(pore.pressure)
    system = mechanics.System(mechanics.of(pore))
    strained = system.deformed(grid.points[grid.body])
    P = pore.pressure[grid.cells[grid.biomass][:, :3]] @ elements.LINEAR.T
    stress = modulus * growth.cauchy(strained.F, P)
    expansion = (pore.active + pore.inert)[grid.cells[grid.biomass]] @ elements.QUADRATIC.T * system.body.expanded
    names = ("stress_xx_MPa", "stress_yy_MPa", "stress_zz_MPa", "stress_xy_MPa")
    values = dict(zip(names, np.moveaxis(stress, -1, 0)), theta=expansion, J=strained.J,
                  largest_principal_stress_MPa=growth.largest_principal(stress))
    for name, value in values.items():
        cells[name] = np.full(len(grid.cells), 1.0 if name in ("theta", "J") else 0.0)
        cells[name][grid.biomass] = (value * system.at.dx).sum(axis=1) / system.at.dx.sum(axis=1)


def _three(plane: np.ndarray) -> np.ndarray:
    """(N, 3) vectors from plane ones (N, 2)."""
    return np.column_stack([plane, np.zeros(len(plane))])
