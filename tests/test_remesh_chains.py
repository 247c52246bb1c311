"""Chains of remeshes (3.5, [E8]): what both transfers keep on any aggregate, meshed anew again and again."""
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from repro.fem import transfer as of
from repro.model import biomass, pore, remeshing
from repro.model.transport import OVERSHOOT, UNRESOLVED
from tests import oracles
from tests.strategies import ORDERS, angles, remesh_chains, rotation, scenes, share

seeds = st.integers(0, 2**32 - 1)


def rough(points, seed):
    """(N, 1) field without any smoothness, between 0 and 1."""
    return np.random.default_rng(seed).uniform(0.0, 1.0, (len(points), 1))


def smooth(points):
    """(N, 2): one, and a linear field."""
    return np.column_stack([np.ones(len(points)), 2.0 + 0.3 * points[:, 0] - 0.7 * points[:, 1]])


def projected(old, field, new):
    return of.project(*old, field, *new)


def interpolated(old, field, new):
    return of.interpolate(*old, field, new[0])


def along(chain, field, transfer):
    """The field on every mesh of the chain, carried from each to the next."""
    fields = [field]
    for old, new in pairwise(chain):
        fields.append(transfer(old, fields[-1], new))
    return fields


@share(0.4)
@given(remesh_chains(), seeds)
def test_a_chain_of_projections_conserves_mass(chain, seed):
    """To 1e-11, from every mesh to the next (measured: 2e-15)."""
    fields = along(chain, rough(chain[0][0], seed), projected)
    masses = [oracles.mass(*body, field[:, 0]) for body, field in zip(chain, fields)]
    assert masses == pytest.approx([masses[0]] * len(chain), rel=1e-11)


@share(0.4)
@given(remesh_chains())
def test_a_chain_keeps_constant_and_linear_fields(chain):
    """To round-off, with either transfer."""
    for transfer in (projected, interpolated):
        for body, field in zip(chain, along(chain, smooth(chain[0][0]), transfer)):
            exact = smooth(body[0])
            assert np.abs(field - exact).max() < 1e-11 * np.abs(exact).max()


@share(0.4)
@given(remesh_chains(longest=2), seeds)
def test_what_is_carried_to_its_own_mesh_stays(chain, seed):
    """And so does what has been carried once."""
    start = rough(chain[0][0], seed)
    for transfer in (projected, interpolated):
        assert transfer(chain[0], start, chain[0]) == pytest.approx(start, abs=1e-11)
        once = transfer(chain[0], start, chain[1])
        assert transfer(chain[1], once, chain[1]) == pytest.approx(once, abs=1e-11)


@share(0.4)
@given(remesh_chains(longest=3), seeds, angles, st.floats(-1e3, 1e3), st.floats(-1e3, 1e3))
def test_a_chain_does_not_see_how_it_is_turned_and_where_it_lies(chain, seed, angle, x, y):
    """Nor how its nodes are numbered."""
    start = rough(chain[0][0], seed)
    turned = [(points @ rotation(angle).T + [x, y], triangles) for points, triangles in chain]
    shuffled, old = zip(*(numbered(body, np.random.default_rng(seed + k)) for k, body in enumerate(chain)))
    for transfer in (projected, interpolated):
        there, other = along(turned, start, transfer), along(shuffled, start[old[0]], transfer)
        for here, moved, renamed, number in zip(along(chain, start, transfer), there, other, old):
            assert moved == pytest.approx(here, abs=1e-9)
            assert renamed == pytest.approx(here[number], abs=1e-9)


def numbered(body, rng):
    """The same triangles in another order, with other numbers for their nodes: ((points, triangles), old numbers)."""
    points, triangles = body
    old = rng.permutation(len(points))
    new = np.argsort(old)
    return (points[old], new[rng.permutation(triangles)]), old


@share(0.4)
@given(scenes(steps=1, elements=list(ORDERS.values())), seeds,
       st.lists(st.floats(0.4, 0.9), min_size=2, max_size=4))
def test_a_pore_that_is_meshed_again_and_again_keeps_its_biomass(made, seed, refinements):
    """The pore's own remesh, X_A uneven and X_I even: totals to 1e-11 by the conserving transfer, bounds by the
    paper's, X_I even by both; with order 2 and 3, whose masses are X_m all together again, totals of both, and no share
    below zero; the outline's area, and substrates between nothing and the supply."""
    now = pore.seeded(made)
    solved = pore.solve(made, now)
    uneven = np.random.default_rng(seed).uniform(0.5, 1.5, now.active.shape)
    now = replace(filled(made, now, uneven), concentrations=solved.concentrations)
    for refinement in refinements:
        finer = replace(made, numerics=replace(made.numerics, refinement=refinement))
        speed = solved.flow.mean_velocity if solved.flow else 0.0
        then, _ = remeshing.remesh(finer, now, now, speed)
        assert then.outline.area == pytest.approx(now.outline.area, rel=1e-12)
        check_biomass(made, now, then)
        check_substrates(made, then)
        now = then


def filled(made, now, uneven):
    """With X_I = 7 mg/L and uneven X_A; with order 2 and 3 both together X_m, as growth keeps them."""
    dx, density = now.space.reaction.dx, made.kinetics.maximum_density
    if now.space.order == 1:
        return replace(now, active=uneven * density * dx, inert=7.0 * dx)
    inert = uneven / 3
    return replace(now, active=(1 - inert) * density * dx, inert=inert * density * dx)


def check_biomass(made, now, then):
    """What the transfer of the scene promises of the new mesh's biomass."""
    before, after = (one.active / one.space.reaction.dx for one in (now, then))
    if made.numerics.transfer == "conserving":
        assert then.active.sum() == pytest.approx(now.active.sum(), rel=1e-11)
        assert then.inert.sum() == pytest.approx(now.inert.sum(), rel=1e-11)
    else:
        assert before.min() <= after.min() and after.max() <= before.max()
    if then.space.order == 1:
        assert then.inert / then.space.reaction.dx == pytest.approx(np.full(then.inert.shape, 7.0), rel=1e-10)
    else:
        assert then.active.min() >= 0 and then.inert.min() >= 0
    outside = np.setdiff1d(np.arange(len(then.mesh.points)), then.mesh.body)
    assert not biomass.at_nodes(then.space, after)[outside].any()


def check_substrates(made, then):
    """Interpolated: with linear functions within their bounds; with order 2 and 3 an interpolant may overshoot."""
    room = 1e-12 if then.space.order == 1 else OVERSHOOT
    both = (made.substrates.acceptor, then.concentrations.acceptor), (made.substrates.donor, then.concentrations.donor)
    largest = max(substrate.supply for substrate, _ in both)
    for substrate, field in both:
        assert len(field) == then.space.count
        assert field.min() >= -(0.0 if then.space.order == 1 else UNRESOLVED * largest)
        assert field.max() <= substrate.supply * (1 + room)
