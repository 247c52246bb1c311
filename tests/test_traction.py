"""The fluid's forces on the aggregate: their unit, runs with them, and when shape and flow do not agree; what they are
is in the cases coupling-traction."""
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from repro.errors import GrowthError, StageError
from repro.march.simulation import simulate
from repro.model import contact, pore, traction
from repro.results import row
from repro.scene import load_scene
from tests.strategies import ORDERS

EVERY_ORDER = pytest.mark.parametrize("order", ORDERS)


def base(*changes, order=1):
    refinement = 0.6 if order == 1 else 0.3
    return load_scene("base", ['numerics.preset="paper"', f"numerics.elements={ORDERS[order]}",
                               f"numerics.refinement={refinement}", 'growth.time_step="24 min"',
                               'growth.fluid_forces="included"', *changes])


def test_the_unit_is_that_of_water_pressure():
    """A column of 1 cm of water is 97.9 Pa."""
    drive = base().flow
    centimetre = 1e4 * traction.MPA_PER_UM * drive.density * drive.gravity
    assert centimetre == pytest.approx(998 * 9.81 * 0.01 * 1e-6, rel=1e-12)


@EVERY_ORDER
@pytest.mark.parametrize("density, rounds, error, said", [
    ("1e9 mg/cm^3", contact.FORCE_ROUNDS, StageError, "try a"),
    ("998 mg/cm^3", 1, GrowthError, "do not agree after 1 rounds, a node still moves by .* um: .*try a shorter")])
def test_a_shape_that_the_forces_do_not_let_rest_is_refused(monkeypatch, density, rounds, error, said, order):
    """In water whose pressure is a thousand times the stiffness, or where rounds do not end: an error that says what to
    do, neither a hang nor a shape."""
    monkeypatch.setattr(contact, "FORCE_ROUNDS", rounds)
    made = base(f'flow.density="{density}"', order=order)
    now = pore.seeded(made)
    with pytest.raises(error, match=said):
        contact.expand(made, now, 1.1 * now.theta)


@cache
def pushed(order):
    """Last rows without and with the fluid's forces, and Newton's iterations of both runs."""
    rows = []
    for word in ("neglected", "included"):
        said = base('growth.end="2 h"', f'growth.fluid_forces="{word}"', order=order)
        *_, last = simulate(said)
        rows.append((row(said, last), last.iterations["growth"]))
    return rows


@EVERY_ORDER
def test_a_run_with_them_is_pushed_downstream_and_counts_its_rounds(order):
    """By linear elements to 20 %, by quadratic ones to 1 % as far as by cubic ones."""
    (plain, few), (moved, many) = pushed(order)
    assert 0 < moved["upstream_um"] - plain["upstream_um"] < 1e-4
    assert 0 < moved["downstream_um"] - plain["downstream_um"] < 1e-4
    assert many > few
    assert abs(moved["biomass_balance"]) < 1e-10
    (still, _), (exact, _) = pushed(3)
    for name in ("upstream_um", "downstream_um"):  # measured: 15 % and 0.04 %
        assert moved[name] - plain[name] == pytest.approx(exact[name] - still[name], rel=0.2 if order == 1 else 0.01)


@EVERY_ORDER
def test_a_shape_with_its_own_mesh_needs_no_other(order):
    said = base(order=order)
    now = pore.seeded(said)
    around = traction.surroundings(said, now, now)
    assert around.mesh is now.mesh and around.share.shape == (len(now.mesh.body), 1)
    twice = replace(said, flow=replace(said.flow, density=2 * said.flow.density))
    one, two = (traction.forces(s, around, now) for s in (said, twice))
    assert np.allclose(two, 2 * one, rtol=1e-14)
    drive = said.flow
    on = traction.nodal(now.space, pore.solve_flow(said, now.space), drive.kinematic_viscosity / drive.gravity,
                        "laplacian")
    pascal = 9.81 * 1e-3 * drive.density * 1e-6  # of a head of 1 um; 1 mg/L is 1e-3 kg/m3
    wanted = on[now.mesh.body] * pascal * 1e-6 / said.growth.shear_modulus
    assert one == pytest.approx(wanted, rel=1e-3, abs=1e-3 * np.abs(wanted).max())
