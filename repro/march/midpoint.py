"""One step of the midpoint rule with linear elements: see :mod:`repro.march.stepping`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from repro.fem import reprojection
from repro.march.coupling import Attempt, Ledger, PoreEnd, Step, increase, mass_of, pore_end, rates_of
from repro.model import kinetics, remeshing, shape
from repro.model.pore import Pore, Solved, seeded, solve

__all__ = ["attempt", "seeded", "solve"]


def attempt(scene, now: Pore, solved: Solved, duration: float, most: float = np.inf) -> Attempt:
    """A step of ``duration`` (h), if the rates change by no more than ``most`` (1/h) over its first half. Raises
    StageError where it cannot be made."""
    first = rates_of(scene, solved.concentrations)
    half, rates = half_way(scene, now, solved, first, duration)
    weight = now.mesh.lumped(now.mesh.biomass)
    change = float(weight @ np.abs(rates[0] + rates[1] - first[0] - first[1]) / weight.sum())
    if change > most:
        return Attempt(None, change, None)
    grown = _grown(now, rates, duration)
    expanded, iterations, gap = _expanded(scene, now, grown)
    if leaves := pore_end(scene, expanded, 0.1):
        raise PoreEnd(f"{leaves} in the step from t = {now.time:g} h")
    same = len(half.concentrations.acceptor) == len(now.mesh.points)
    carried = half if same else solved
    after, remeshed = remeshing.new_mesh(scene, now, expanded, replace(carried, flow=solved.flow))
    made = float(np.sum(weight * (grown.active + grown.inert - now.active - now.inert)))
    flows = {key: tuple(duration * getattr(flux, key) for flux in half.fluxes)
             for key in ("supplied", "out", "consumed")}
    ledger = Ledger(now.time, now.time + duration, **flows, stored=(0.0, 0.0), biomass_before=mass_of(now),
                    biomass_made=made, biomass_after=mass_of(after))
    return Attempt(Step(after, (now, solved), ledger, remeshed, iterations), change,
                   first_contact(scene, now, expanded, gap))


def half_way(scene, now: Pore, solved: Solved, first, duration: float):
    """What is solved in the shape that half the step makes with the rates of its start, and the rates there at the
    nodes of the present mesh: where a new mesh had to be made they are carried back to the material's nodes."""
    moved, _, _ = _expanded(scene, now, _grown(now, first, duration / 2))
    there, remeshed = remeshing.new_mesh(scene, now, moved, solved)
    found = solve(scene, there)
    rates = rates_of(scene, found.concentrations)
    if not remeshed:
        return found, rates
    back, nodes = np.zeros((len(now.mesh.points), 2)), now.mesh.body
    back[nodes] = reprojection.interpolate(there.mesh.points, there.mesh.triangles[there.mesh.biomass],
                                           np.column_stack(rates), moved.mesh.points[nodes])
    return found, tuple(back.T)


def _grown(now: Pore, rates, duration: float) -> Pore:
    active, inert = kinetics.grow(now.active, now.inert, rates[0], rates[1], duration)
    return replace(now, active=active, inert=inert)


def _expanded(scene, now: Pore, grown: Pore) -> tuple[Pore, int, float]:
    return shape.expand(scene, grown, now.theta * (1 + increase(now, grown) / scene.kinetics.maximum_density))


def first_contact(scene, now, expanded, gap: float) -> tuple[float, float, float] | None:
    """Least distance to the opposite wall before and after a step that makes contact, and the film's least thickness;
    None where contact is not made, or was there before."""
    if now.contact or not expanded.contact:
        return None
    return scene.pore.width - now.outline.thickness, gap, scene.growth.minimum_film
