"""The reference of the whole base run: its growth, flow and transport, and its order in time."""
import numpy as np
import pytest

from reference import taylor_hood, whole_run
from reference.monod import uptake
from reference.whole_run import Pore, Run
from reference.whole_run_grid import grid
from reference.whole_run_pore import Section

WIDTH, SPEED = 50.0, 61_000.0
PORE = Pore()


def half_disc(rings):
    """The section of a half-disc of 30 um, its ends 75 um from it."""
    found, ends = grid(rings), (-105.0, 105.0)
    return Section(found, found.around(30.0 * found.seed, WIDTH, ends), WIDTH, ends)


def test_the_defaults_are_table_1():
    """Each from the units of Table 1."""
    assert PORE.viscosity * 3600 == pytest.approx(0.01003e-4 / 9.81 * 1e6)  # nu / g is 1.02e-7 m s
    assert [24 * D / 1e8 for D in PORE.diffusivity] == pytest.approx([2.32, 1.01])
    assert [24 * D / 1e8 for D in PORE.in_biomass] == pytest.approx([1.85, 0.81])
    assert [24 * PORE.k, 24 * PORE.b, 24 * PORE.rates["decay"]] == pytest.approx([9.3, 0.12, 0.13632])


def test_the_loss_around_a_half_disc_is_that_of_other_meshes():
    """Both are within 3e-4 of 3.92504, what 24 rings find."""
    other = taylor_hood.stokes(taylor_hood.half_disc(WIDTH, (-105.0, 105.0), 30.0, 1), PORE.ratio).loss
    assert half_disc(6).flow(PORE.ratio).loss == pytest.approx(other, rel=3e-4)


def test_what_is_supplied_is_carried_out_or_taken_up():
    """With X_A = X_m in the body; the defect over the supply falls at third order or more."""
    defects = []
    for rings in (2, 4):
        section = half_disc(rings)
        flow, active = section.flow(PORE.ratio), np.full(section.body.dx.shape, PORE.density)
        start = np.multiply.outer(PORE.supply, np.ones(section.whole.N))
        fields = section.steady(section.operators(PORE, SPEED, flow), active, PORE.rates, start)
        taken = np.sum(active * uptake(*section.inside(fields), PORE.rates) * section.body.dx, axis=(1, 2))
        lost = PORE.supply - section.effluents(flow, fields) - taken / (SPEED * WIDTH)
        defects.append(np.abs(lost).max() / PORE.supply[0])
    assert defects[1] < 1e-4 and defects[0] / defects[1] > 8


def test_a_step_in_time_is_of_fourth_order():
    """A step and two halves differ as the fifth power."""
    run = Run(PORE, 2)
    one, half = run.step(run.seed, 4.0), run.step(run.seed, 2.0)
    two, four = run.step(half, 2.0), run.step(run.step(run.seed, 1.0), 1.0)
    first, second = (np.abs(a - b).max() for a, b in ((one, two), (half, four)))
    assert 4.5 < np.log2(first / second) < 5.5


def test_three_runs_are_extrapolated(monkeypatch):
    """Errors 54 / rings^3 and 32 / steps^4 are found."""
    monkeypatch.setattr(whole_run, "numbers", lambda pore, rings, steps, _: 7.0 + 54 / rings**3 + 32 / steps**4)
    found = whole_run.converged(PORE, (), rings=(2, 3), steps=(1, 2))
    assert [found.values, found.space, found.time] == pytest.approx([7.0, -2.0, -2.0])
