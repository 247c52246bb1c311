"""Every end of the model is located in time, by both schemes; a row at a jump, and that at t = 0, has one state."""

from dataclasses import dataclass
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

import repro
from repro import results
from repro.errors import GrowthError, RunEnd
from repro.fem.sizing import ACROSS_PORE
from repro.march import loop
from repro.march.ends import CLOSE, Event, Reached, Strength, _detachment, locate
from repro.march.folding import fold_message, most_compressed
from repro.march.state import Compression
from repro.model.adhesion import Peak
from repro.model.configuration import FromPrevious
from repro.model.energies.neo_hookean import BIOT
from repro.model.meshing import seeded
from repro.runs.status import is_fold, is_over
from tests.test_fold import SETS as PLUG
from verification.problems.schemes import exchange, load_scene

SCHEMES = pytest.mark.parametrize("scheme", ["updates", "midpoint"])
#: Long steps on coarse curved elements.
COARSE = ("numerics.preset=fast", "growth.time_step=0.5 h", 'growth.end="3 h"')
BONDED = (*COARSE, "growth.wall=bonded")
#: A seed of 5 um in a pore of 200 um, whose middle is 8.7 um from an end.
SHORT = (*COARSE, "pore.length=200 um")
ELEMENT = 50 / ACROSS_PORE
#: Times (h) of requested rows, besides growth.end.
TIMES = (0.1, 0.2, 1.0, 1.8)


@dataclass(frozen=True)
class Case:
    """A scene that ends: its changes of base, those that do not take part in the event, and the margin of a row."""

    changes: tuple
    margin: object
    status: str
    limit: tuple = ()
    unset: tuple = ()
    end: float = 3.0


CASES = {
    "detachment": Case(BONDED, lambda row: row["wall_traction_max_MPa"] / 0.002 - 1, "the aggregate detaches at",
                       ("growth.bonding_strength=0.002 MPa",)),
    "tearing": Case(BONDED, lambda row: row["tensile_stress_max_MPa"] / 5e-4 - 1, "the aggregate tears at",
                    ("growth.tensile_strength=5e-4 MPa",)),
    "fold": Case((*PLUG, "growth.time_step=3 h"), lambda row: BIOT / row["surface_stretch_min"] - 1,
                 "the aggregate's surface folds at", unset=("aggregate.radius",), end=6.0),
    "upstream": Case((*SHORT, "aggregate.position=-91.3 um"), lambda row: 1 - (100 + row["upstream_um"]) / ELEMENT,
                     "the aggregate reaches the pore's upstream end at"),
    "downstream": Case((*SHORT, "aggregate.position=91.3 um"), lambda row: 1 - (100 - row["downstream_um"]) / ELEMENT,
                       "the aggregate reaches the pore's downstream end at"),
}


def rows_of(scene):
    """The rows, their ledgers, and the end of a run."""
    rows, ledgers, status = [], [], "completed"
    try:
        for report in repro.simulate(scene):
            rows.append(results.row(scene, report))
            ledgers += report.ledgers
    except RunEnd as end:
        status = str(end)
    return rows, ledgers, status


@cache
def ended(name, scheme, *changes):
    """A case with a scheme: its rows, ledgers and status."""
    case = CASES[name]
    times = f"output.times={[f'{time!r} h' for time in (*TIMES, case.end)]}"
    return rows_of(load_scene("base", [*case.changes, times, *case.limit, exchange(steps=scheme), *changes],
                              unset=case.unset))


@pytest.mark.parametrize("name, scheme", [
    pytest.param(name, scheme, marks=pytest.mark.thorough if name == "fold" else ())
    for name in CASES for scheme in ("updates", "midpoint")])
def test_every_end_is_located_within_its_step(name, scheme):
    """The last row is at the event, to the accuracy of events. The requested rows before it are kept, and none follows.
    The ledgers lead to the event."""
    case = CASES[name]
    rows, ledgers, status = ended(name, scheme)
    margins = [case.margin(row) for row in rows]
    time = rows[-1]["time_h"]
    assert 0 < margins[-1] <= CLOSE and max(margins[:-1]) < 0
    assert status.startswith(f"{case.status} t = {time:g} h") and is_over(status)
    assert [row["time_h"] for row in rows] == [0.0, *(each for each in TIMES if each < time), time]
    assert TIMES[0] < time < case.end
    assert [ledger.start for ledger in ledgers] == pytest.approx([0.0, *(ledger.end for ledger in ledgers[:-1])])
    assert ledgers[-1].end == pytest.approx(time, abs=1e-9)


@pytest.mark.parametrize("number, name", [(0, "one"), (1, "two")])
def test_a_fold_names_the_aggregate(number, name):
    """The material of one of two seeds was twice as long: its surface is compressed. The fold's status is that of an
    end."""
    seeds = 'aggregate=[{radius="5 um", name="one"}, {radius="5 um", wall="upper", name="two"}]'
    pore = seeded(load_scene("base", [*COARSE, seeds])).focused(number)
    longer = FromPrevious(pore.body.reference * [2.0, 1.0])
    compression = most_compressed(Compression(), pore.with_body(configuration=longer))
    assert compression.stretch < 0.8
    status = fold_message("at t = 3 h", compression)
    assert status.startswith(f"aggregate {name}'s surface folds at t = 3 h: ") and is_fold(status)


def test_rows_before_an_end_are_those_of_the_full_step():
    """They are those of a run without the strength, to the last bit."""
    case = CASES["detachment"]
    times = f"output.times={[f'{time!r} h' for time in (*TIMES, case.end)]}"
    without, _, status = rows_of(load_scene("base", [*case.changes, times]))
    rows, _, _ = ended("detachment", "midpoint")
    assert status == "completed" and len(rows) > 3 and rows[:-1] == without[:len(rows) - 1]


@pytest.mark.parametrize("first", ["detachment", pytest.param("tearing", marks=pytest.mark.thorough)])
def test_the_first_of_two_ends_in_a_step_counts(first):
    """The other strength is just above or below the stress at the event."""
    other = {"detachment": "tearing", "tearing": "detachment"}[first]
    column = {"detachment": "wall_traction_max_MPa", "tearing": "tensile_stress_max_MPa"}[other]
    key = {"detachment": "growth.bonding_strength", "tearing": "growth.tensile_strength"}[other]
    rows, _, _ = ended(first, "updates")
    rows_with_both = ended(first, "updates", f"{key}={1.01 * rows[-1][column]!r} MPa")
    assert rows_with_both[2].startswith(CASES[first].status)
    earlier = ended(first, "updates", f"{key}={0.99 * rows[-1][column]!r} MPa")
    assert earlier[2].startswith(CASES[other].status) and earlier[0][-1]["time_h"] < rows[-1]["time_h"]


@pytest.mark.parametrize("key, strength, unit, in_MPa", [
    ("bonding_strength", 0.002, "MPa", 1.0), ("bonding_strength", 2.0, "kPa", 1e-3),
    ("tensile_strength", 500.0, "Pa", 1e-6)])
def test_a_stress_is_reported_in_the_unit_of_its_strength(key, strength, unit, in_MPa):
    scene = load_scene("base", [*BONDED, f"growth.{key}={strength} {unit}"])
    peak = Peak(1.5 * strength * in_MPa, 1.0, 2.0)
    pore = SimpleNamespace(time=1.5, name_of=lambda number: "the aggregate")
    event = _detachment(Strength.of(scene, key), pore, 0, peak, "detaches", "its wall must bear")
    assert event.margin == pytest.approx(0.5)
    assert f" {1.5 * strength:.3g} {unit}, in the mean" in str(event.end)
    assert str(event.end).endswith(f"growth.{key} is {strength:g} {unit}")


def reached(margin):
    """Steps whose margin is a function of the time."""
    def reach(time):
        return Reached(SimpleNamespace(pore=SimpleNamespace(time=time)), None, Event(margin(time), RunEnd()))

    return reach


@pytest.mark.parametrize("margin, zero", [
    (lambda t: t**3 / 8 - 1, 2.0), (lambda t: 1 - 8 / t**3 if t else -1e9, 2.0), (lambda t: np.expm1(9 * (t - 2)), 2.0),
    (lambda t: 1.0 if t >= 2.3 else -1.0, 2.3), (lambda t: -0.1 if t < 1e-7 else 3.0, 0.0)])
def test_an_event_is_located_from_its_function(margin, zero):
    """Smooth functions and jumps, within few steps."""
    times = []

    def reach(time):
        times.append(time)
        return reached(margin)(time)

    event = locate(reach, 0.0, margin(0.0), reached(margin)(5.0))
    assert event.event.margin > 0 and event.time == pytest.approx(zero, rel=1e-4, abs=2e-7) and len(times) <= 40


@pytest.mark.parametrize("margins", [(-0.02, 0.04, -0.05, 0.02), (0.01, -0.02, 0.05, 0.03)])
def test_a_margin_that_falls_between_trials_errs_by_the_fall(margins):
    """It falls by 0.03 before the event, or by 0.04 after it. The first margin up to this error ends the search."""
    left = list(margins)
    event = locate(lambda time: reached(lambda _: left.pop(0) if left else CLOSE / 2)(time), 0.0, -1.0,
                   reached(lambda t: t / 2 - 1)(5.0))
    assert event.event.margin == margins[-1]


#: Two bonded seeds. In an acute corner of the water each mesh has more poor triangles than a moved mesh may have.
ACUTE = ("numerics.preset=fast", "pore.width=50 um", "pore.length=1200 um", "flow.mean_velocity=10 m/day",
         "growth.wall=bonded", "growth.bonding_strength=6 kPa", 'growth.end="20 h"', 'output.times=["20 h"]',
         *(f"substrates.{name}.supply=0.85 mg/L" for name in ("acceptor", "donor")),
         'aggregate=[{radius="5.7 um", position="-79.7 um", wall="upper"}, {radius="5.5 um", position="-91.3 um"}]')


def test_trials_share_a_mesh(monkeypatch):
    """Margins on one mesh are smooth. The search needs few trials, as for a function, and ends within CLOSE."""
    trials = []

    def counted(reach, start, margin, passed):
        def noted(time):
            trials.append(reach(time))
            return trials[-1]
        return locate(noted, start, margin, passed)

    monkeypatch.setattr(loop, "locate", counted)
    with pytest.raises(repro.Detachment):
        list(repro.simulate(load_scene("wide", ACUTE)))
    assert trials[0].step.remeshed and 0 < trials[-1].event.margin <= CLOSE and len(trials) <= 8
    assert trials[-1].step.pore.mesh.topology is trials[-2].step.pore.mesh.topology


@pytest.mark.parametrize("error", [GrowthError("no rest"), FloatingPointError("overflow"), repro.PoreEnd("outside")])
def test_an_end_is_not_a_failure_if_a_shorter_step_fails(error):
    """The run ends with the shortest step that has passed the event, and says that the event may lie earlier."""
    def reach(time):
        if time < 2.2:
            raise error
        return reached(lambda t: t - 2)(time)

    event = locate(reach, 0.0, -2.0, reached(lambda t: t - 2)(5.0))
    assert 2.2 <= event.time <= 5
    assert str(event.event.end).endswith(f"it may happen earlier, after t = 0 h, since a shorter step fails: {error}")


#: Scenes whose tables jump at 0.4 h.
SUPPLIED = ("numerics.preset=fast", "growth.time_step=0.4 h", 'growth.end="0.4001 h"')
#: With a soft aggregate under forces of the fluid.
FORCED = (*SUPPLIED, "growth.fluid_forces=included", "growth.shear_modulus=1e-3 MPa")
#: The traction rises as the aggregate grows, and is mostly that of the flow.
BONDED_WALL = ("growth.wall=bonded", "growth.shear_modulus=4e-6 MPa")
JUMPS = {
    "head": ([*FORCED, 'flow.head=[["0 h", "4e-3 cm"], ["0.4 h", "12e-3 cm"]]'], [], (
        "mean_velocity_m_per_d", "head_loss_cm", "fluid_force_x_uN_per_m", "fluid_force_y_uN_per_m",
        "fluid_moment_nN", "wall_traction_max_MPa", "tensile_stress_max_MPa", "effluent_acceptor_mg_per_L")),
    "velocity": ([*FORCED, 'flow.mean_velocity=[["0 h", "3 m/day"], ["0.4 h", "9 m/day"]]'], ["flow.head"], (
        "mean_velocity_m_per_d", "head_loss_cm", "fluid_force_x_uN_per_m", "wall_traction_max_MPa",
        "effluent_donor_mg_per_L")),
    **{name: ([*SUPPLIED, f'substrates.{name}.supply=[["0 h", "4 mg/L"], ["0.4 h", "8 mg/L"]]'], [], (
        f"effluent_{name}_mg_per_L", f"inlet_{name}_mg_per_L", f"{name}_min_mg_per_L"))
       for name in ("acceptor", "donor")},
}
#: Columns that belong to the steps before a row, not to its state.
OF_STEPS = {"time_h", "remeshed", "nodes"}
#: Defects, and places that may change while the value there does not.
UNSTEADY = ("_balance", "_overshoot_mg_per_L", "_max_x_um", "_max_y_um", "_min_x_um", "_min_y_um")


@SCHEMES
@pytest.mark.parametrize("name", [pytest.param(name, marks=pytest.mark.thorough if name == "head" else [])
                                  for name in JUMPS])
def test_a_row_at_a_jump_has_the_state_just_after_it(name, scheme):
    """All columns at the jump, and at t = 0, are those 1e-5 h later, and the jumping ones differ from those 1e-5 h
    before the jump. In 1e-5 h no column changes by 1e-4."""
    changes, unset, jumping = JUMPS[name]
    times = [0.0, 1e-5, 0.4 - 1e-5, 0.4, 0.4 + 1e-5]
    scene = load_scene("base", [*changes, exchange(steps=scheme),
                                f"output.times={[f'{time!r} h' for time in times]}"], unset=unset)
    first, soon, before, jump, after, *_ = rows_of(scene)[0]
    for key in first.keys() - OF_STEPS:
        if first[key] is None or key.endswith(UNSTEADY):
            continue
        scale = 1e-4 * max(abs(jump[key]), 1e-9)
        assert soon[key] == pytest.approx(first[key], rel=1e-4, abs=scale), key
        assert after[key] == pytest.approx(jump[key], rel=1e-4, abs=scale), key
    for key in jumping:
        assert abs(before[key] / jump[key] - 1) > 1e-3, key


@cache
def strength():
    """MPa, the traction after 0.3 h under the strong flow."""
    changes = [*FORCED, *BONDED_WALL, "growth.end=0.3 h", "flow.head=12e-3 cm",
               'output.times=["0.3 h"]']
    return rows_of(load_scene("base", changes))[0][1]["wall_traction_max_MPa"]


@pytest.mark.parametrize("rising, scheme", [
    (True, "updates"), (False, "midpoint"),
    *(pytest.param(*case, marks=pytest.mark.thorough) for case in ((True, "midpoint"), (False, "updates")))])
def test_a_jump_is_judged_on_both_sides(rising, scheme):
    """Before a jump down the run ends within the step to the jump, where the traction reaches the strength under the
    strong flow. After a jump up it ends at the jump."""
    heads = ("4e-3 cm", "12e-3 cm") if rising else ("12e-3 cm", "4e-3 cm")
    table = f'flow.head=[["0 h", "{heads[0]}"], ["0.4 h", "{heads[1]}"]]'
    changes = [*FORCED, *BONDED_WALL, exchange(steps=scheme), table, f"growth.bonding_strength={strength()!r} MPa",
               'output.times=["0.4001 h"]']
    rows, _, status = rows_of(load_scene("base", changes))
    assert status.startswith("the aggregate detaches")
    assert rows[-1]["time_h"] == pytest.approx(0.4 if rising else 0.3, abs=1e-9 if rising else 3e-3)


@SCHEMES
def test_a_wall_that_is_too_weak_for_the_flow_ends_a_run_at_once(scheme):
    """The traction at t = 0 is that of the aggregate's equilibrium under the forces of the fluid."""
    scene = load_scene("base", [*FORCED, exchange(steps=scheme), "growth.bonding_strength=1e-9 MPa"])
    rows, _, status = rows_of(scene)
    assert len(rows) == 1 and status.startswith("the aggregate detaches at t = 0 h")
