"""One step of the midpoint rule, second order in time: see :mod:`repro.march.stepping`.

Half a step with the rates of its start gives the shape half way. There the substrates are solved
with the *mean* biomass of the step, that which the very rates make that are found: M (e^z - 1) / z
of a mass M that grows by e^z. These rates carry (9)-(10) over the whole step. So what is taken up
and what is made in a step are one integral, and both balances close to round-off.

Within the step, at the part s of its length h, (9)-(10) are carried over s h with the rates
(1 - s) k_1 + s k_2 of its start and of half way: the rule's own interpolation, of second order too
and k_2 over h at its end (Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I,
section II.6). Shape, contact and mesh follow from the start's as in a step, flow and substrates are
solved there.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from repro.fem import transfer
from repro.fem.space import Space
from repro.march.folding import refuse_density, refuse_fold
from repro.march.loop import Ledger, Moment, PoreEnd, Step, pore_end
from repro.march.updates import before, enlarged, grown, rates_of
from repro.model import biomass, contact, pore, remeshing
from repro.model.biomass import Rates
from repro.model.contact import Expansion
from repro.model.contact_lines import FirstContact, SearchOptions
from repro.model.gear import Flows
from repro.model.pore import Pore, Solved
from repro.model.transport import Concentrations
from repro.scene import Scene, needed


@dataclass(frozen=True, eq=False)
class Attempt:
    """A step of the midpoint rule that may be taken: what it makes, None where the rates change
    more than is allowed, or where it ends long after the first contact; the mean change of the
    rates over its first half, 1/h; and, where it makes the first contact with the opposite wall,
    the least distance (um) to that before and after the step."""

    step: Step | None
    change: float
    gaps: tuple[float, float] | None = None


@dataclass(frozen=True, eq=False)
class Halfway:
    """What half a step has found.

    duration: h, of the whole step; first: rates at its start; expansion: the aggregate half way;
    solved: flow and substrates there; rates: there, at the points of the mesh at the start; made:
    growth of active and of inert biomass over the whole step, um2 mg/L.
    """

    duration: float
    first: Rates
    expansion: Expansion
    solved: Solved
    rates: Rates
    made: tuple[float, float]


def attempt(scene: Scene, now: Pore, solved: Solved, duration: float, most: float = np.inf,
            search: SearchOptions = contact.PATIENT) -> Attempt:
    """A step of ``duration`` (h), if the rates change by no more than ``most`` (1/h) over its first
    half. Raises StageError where it cannot be made."""
    first = rates_of(scene, now, solved.concentrations)
    gap = scene.pore.width - now.boundary.thickness
    try:
        half = halfway(scene, now, solved, first, duration, search)
    except FirstContact as early:
        return Attempt(None, 0.0, (gap, gap - 2 * (gap - early.gap)))
    change = biomass.change(first, half.rates, now.space.reaction.dx)
    if change > most:
        return Attempt(None, change)
    after = _matched(now, grown(now, half.rates, duration), half.made)
    after = replace(after, time=before(now, duration))
    try:
        expansion = _expanded(scene, now, after, half, 1.0, search)
    except FirstContact as early:
        return Attempt(None, 0.0, (gap, early.gap))
    expanded = expansion.pore
    if leaves := pore_end(scene, expanded, 0.1):
        raise PoreEnd(f"{leaves} in the step from t = {now.time:g} h")
    refuse_fold(now, expanded)
    expanded = replace(expanded, concentrations=_extrapolated(solved, half.solved, 1.0))
    new, remeshed = remeshing.new_mesh(scene, now, expanded, _speed(solved))
    refuse_density(scene, new)
    ledger = Ledger(now.time, now.time + duration, *_flows(half.solved, duration), now.mass,
                    after.mass - now.mass, new.mass)
    inner = partial(within, scene, now, solved, half)
    step = Step(new, (now, solved), ledger, remeshed, expansion.iterations, inner)
    makes_contact = expanded.contact and not now.contact
    return Attempt(step, change, (gap, expansion.gap) if makes_contact else None)


def _expanded(scene: Scene, now: Pore, after: Pore, half: Halfway, part: float,
              search: SearchOptions) -> Expansion:
    """The aggregate in a part of the step, searched for from where half the step leads: contact
    lines go on at their speed."""
    advances = {key: 2 * part * arcs for key, arcs in half.expansion.advances.items()}
    return contact.expand(scene, after, enlarged(scene, now, after),
                          _ahead(now, half.expansion, part), replace(search, advances=advances))


def _flows(solved: Solved, duration: float) -> Flows:
    """What the fluxes of acceptor and donor come to in a step (h)."""
    acceptor, donor = ((duration * flux.supplied, duration * flux.out, duration * flux.consumed)
                       for flux in needed(solved.fluxes, "[substrates]"))
    supplied, out, consumed = zip(acceptor, donor)
    return Flows(supplied, out, consumed, stored=(0.0, 0.0))


def halfway(scene: Scene, now: Pore, solved: Solved, first: Rates, duration: float,
            search: SearchOptions) -> Halfway:
    """Solve in the shape that half of ``duration`` (h) makes with the rates of its start. Where the
    moved mesh is not acceptable a new one is made: masses go to its points, and the rates back to
    those of the material."""
    ahead = replace(grown(now, first, duration / 2), time=now.time + duration / 2)
    expansion = contact.expand(scene, ahead, enlarged(scene, now, ahead), _scaled(now, ahead),
                               search)
    shape = expansion.pore
    mesh = remeshing.followed(scene, now, shape)
    if mesh is not None:
        there = replace(now, space=Space(mesh, now.space.order), time=shape.time)
    else:
        amounts = tuple(expansion.amounts(amount, now) for amount in (now.active, now.inert))
        there, (active, inert) = remeshing.remesh(scene, now, shape, _speed(solved), amounts)
        there = replace(there, active=active, inert=inert)
    found = pore.solve(scene, there, duration)
    rates = rates_of(scene, there, found.concentrations)
    after = grown(there, rates, duration)
    if mesh is None:
        rates = _carried_back(there, now, expansion, rates)
    made = float((after.active - there.active).sum()), float((after.inert - there.inert).sum())
    return Halfway(duration, first, expansion, found, rates, made)


def within(scene: Scene, now: Pore, solved: Solved, half: Halfway, time: float) -> Moment:
    """The pore at a time (h) within a step, and what is solved there. Raises StageError where that
    cannot be."""
    part = (time - now.time) / half.duration
    mean = Rates((1 - part) * half.first.growth + part * half.rates.growth,
                 (1 - part) * half.first.remains + part * half.rates.remains)
    after = replace(grown(now, mean, part * half.duration), time=time)
    expanded = _expanded(scene, now, after, half, part, contact.PATIENT).pore
    expanded = replace(expanded, concentrations=_extrapolated(solved, half.solved, part))
    there, _ = remeshing.new_mesh(scene, now, expanded, _speed(solved))
    return Moment(*remeshing.resolved(scene, there))


def _speed(solved: Solved) -> float:
    """Mean velocity, um/h; zero without flow."""
    return solved.flow.mean_velocity if solved.flow else 0.0


def _carried_back(there: Pore, now: Pore, half: Expansion, rates: Rates) -> Rates:
    """Rates at the points of a new mesh, interpolated to those of the material's mesh before."""
    mesh = there.mesh
    body = now.mesh.body
    nodal = np.column_stack([biomass.at_nodes(there.space, field)
                             for field in (rates.growth, rates.remains)])
    carried = np.zeros((len(now.mesh.points), 2))
    carried[body] = transfer.interpolate(mesh.points, mesh.cells[mesh.biomass], nodal,
                                         half.position[body])
    growth, remains = (biomass.at_points(now.space, column) for column in carried.T)
    return Rates(growth, remains)


def _matched(now: Pore, after: Pore, made: tuple[float, float]) -> Pore:
    """The pore with what was made half way, to the last bit: what an interpolation of the rates has
    lost or added is spread over the active biomass as that is."""
    share = now.active / now.active.sum()
    lacking = [wanted - float((new - old).sum()) for wanted, new, old in
               zip(made, (after.active, after.inert), (now.active, now.inert))]
    return replace(after, active=after.active + lacking[0] * share,
                   inert=after.inert + lacking[1] * share)


def _extrapolated(start: Solved, half: Solved, part: float) -> Concentrations:
    """A first guess of the substrates in a part of the step: as the first half of it has changed
    them, and so on. Where that takes one below zero, what they are half way; where the mesh there
    is another, what they are at the start."""
    first = needed(start.concentrations, "[substrates]")
    second = needed(half.concentrations, "[substrates]")
    if len(second.acceptor) != len(first.acceptor):
        return first
    acceptor = first.acceptor + 2 * part * (second.acceptor - first.acceptor)
    donor = first.donor + 2 * part * (second.donor - first.donor)
    if min(acceptor.min(), donor.min()) < 0:
        return second
    return replace(first, acceptor=acceptor, donor=donor)


def _scaled(now: Pore, after: Pore) -> Pore:
    """A first guess of the shape: all lengths grow alike, while the aggregate is free."""
    if now.contact:
        return after
    fixed = now.boundary.points[now.fixed][:1]
    return _placed(after, fixed + (now.mesh.points - fixed) * np.sqrt(after.mass / now.mass))


def _ahead(now: Pore, half: Expansion, part: float) -> Pore:
    """A first guess of the shape in a part of the step: as half the step has changed it, and so
    on."""
    corners = now.mesh.corners
    push = now.pressure + 2 * part * (half.pore.pressure[:corners] - now.pressure)
    points = now.mesh.points + 2 * part * (half.position - now.mesh.points)
    return _placed(replace(now, pressure=push), points)


def _placed(after: Pore, points: np.ndarray) -> Pore:
    """The pore with its aggregate's nodes at guessed places, unless they turn a triangle over."""
    body = after.mesh.body
    guess = after.mesh.points.copy()
    guess[body] = points[body]
    moved = after.moved(guess)
    biomass_cells = np.flatnonzero(moved.mesh.biomass)
    return after if moved.mesh.turned_over(biomass_cells).any() else moved
