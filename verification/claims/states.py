"""Geometries and fields that several claims look at: saved ones, and aggregates of a given shape."""

from __future__ import annotations

from dataclasses import dataclass, replace

import meshio
import numpy as np

from repro.fem import geometry, mesh
from repro.fem.mesh import PoreMesh
from repro.model import flow, kinetics, transport
from repro.model.pore import sizing


def saved_mesh(fields: meshio.Mesh, width: float) -> PoreMesh:
    """The mesh of saved fields; its loop, which flow and transport do not need, is left empty."""
    points = np.ascontiguousarray(fields.points[:, :2])
    biomass = fields.cell_data_dict["region"]["triangle"] > 0.5
    ends = float(points[:, 0].min()), float(points[:, 0].max())
    return PoreMesh(points, fields.cells_dict["triangle"].astype(np.int64), biomass, np.empty(0, int), width, ends)


@dataclass(frozen=True, eq=False)
class Solution:
    """Flow and substrates in one geometry, with the ledger and the end values of both substrates."""

    flow: flow.Flow
    problem: transport.Problem
    concentrations: transport.Concentrations
    fluxes: tuple[transport.Fluxes, transport.Fluxes]


def solution(scene, grid: PoreMesh, active: np.ndarray, carried_by_u: bool = False) -> Solution:
    """Flow under the scene's drive, then steady substrates over X_A (N,) mg/L.

    carried_by_u: advect with u itself, as the paper writes it, and not with the divergence-free w = u - tau grad p.
    """
    found = flow_in(scene, grid)
    carrier = replace(found, correction=0 * found.correction) if carried_by_u else found
    problem = transport.problem(grid, carrier, scene.substrates, scene.kinetics, scene.numerics.inlet)
    state = transport.steady(problem, active)
    return Solution(found, problem, state, transport.fluxes(problem, active, state))


def flow_in(scene, grid: PoreMesh) -> flow.Flow:
    """Flow under the scene's drive."""
    drive, numerics = scene.flow, scene.numerics
    unit = flow.unit_flow(grid, drive.viscosity_ratio, interface=numerics.interface,
                          stabilisation=numerics.flow_stabilisation)
    return flow.scaled(unit, grid, scene.pore.length, drive.kinematic_viscosity / drive.gravity, head=drive.head,
                       mean_velocity=drive.mean_velocity)


def full_biomass(scene, grid: PoreMesh) -> np.ndarray:
    """X_A (N,) = X_m on the aggregate."""
    active = np.zeros(len(grid.points))
    active[grid.body] = scene.kinetics.maximum_density
    return active


def half_disc(scene, radius: float, reach: float | None) -> PoreMesh:
    """The mesh around a half-disc, to the distance ``reach`` (um) on both sides; None: over the whole pore."""
    end = scene.pore.length / 2 if reach is None else min(radius + reach, scene.pore.length / 2)
    return mesh.generate(geometry.seed(radius, scene.numerics.refinement), (-end, end), sizing(scene))[0]


def growth_rate(scene, fields: meshio.Mesh) -> np.ndarray:
    """(F3 + F4) / X_m (N,), 1/h, zero in the fluid: how fast each place makes biomass."""
    acceptor, donor = fields.point_data["acceptor_mg_per_L"], fields.point_data["donor_mg_per_L"]
    growth = kinetics.growth_rate(acceptor, donor, scene.substrates, scene.kinetics)
    remains = kinetics.inert_rate(acceptor, scene.substrates, scene.kinetics)
    return fields.point_data["active_biomass"] * (growth + remains)
