"""Uniform growth into the opposite wall, on a bonded wall, and of two aggregates that weld, against NGSolve: another
code, other elements.

Substrates are at their supply everywhere and nothing decays, so theta is exp(rate t) in the whole aggregate. The
package's presets run from t = 0. Their steps, new meshes and contact lines are those of every run. The scene has a
bonding strength that no wall reaches, as a scene that asks for tractions has.
"""
from functools import cache

import numpy as np
import pytest

from reference import gold_growth
from repro.fem.walls import TOP, WELD
from repro.march.state import Report
from repro.model import adhesion
from repro.scene import Scene
from verification.evidence.cases import parametrize
from verification.evidence.checks import Check, at_most
from verification.problems import runs
from verification.problems.schemes import load_scene

#: Largest relative errors that presets aim at, by number. They were written before the errors were seen.
AIMS = {"length": {"fast": 4e-3, "accurate": 1.5e-3, "exact": 5e-4}, "tip": dict.fromkeys(runs.QUADRATIC, 2e-4),
        "wall_traction": {"fast": 5e-2, "accurate": 2e-2, "exact": 1e-2},
        "tensile_stress": {"fast": 5e-2, "accurate": 2e-2, "exact": 1e-2}}
#: The largest bar of a reference that judges, over the aim.
SHARE = 0.25
#: Largest errors that are accepted where an aim is missed, by kind of states, number and preset; measured errors of
#: `fast`, `accurate` and `exact` on 2026-11-30 in comments. Runs with other last bits have other meshes, so the limits
#: are larger, by a quarter or more. No limit says that a preset is good: the aims say that.
#: The first state is just after contact, when the length of contact is 7.6 um. At theta = 148 the traction is a
#: sixteenth of that at first contact. Until stresses had 16 instead of 8 triangles along W / 20, tractions erred by up
#: to 4.8, 3.1 and 1.4 % (accepted: 8, 5 and 2.5 %). At 148 the traction changes by 4.5 % if a line moves by 0.01 um:
#: two versions of `accurate` erred by 1.8 % (accepted: 3 %) and, with a line 0.012 um too far, by 5.5 %. Until elements
#: at the lines had a quarter to two thirds of their size, lengths erred by 1.04, 0.28 and 0.21 % (accepted: 1.55, 0.5
#: and 0.25 %) and tractions by 12 to 74, 3.3 and 4.8 % (accepted: 110, 5 and 8 %).
#: Until steps had small triangles at the lines, lengths erred by 2.4, 0.94 and 0.16 %. Until stresses had triangles of
#: their own, they erred by 27 (theta 120) and 95 % (theta 148) in `fast`, and on bonded walls by 51, 55 and 33 % with
#: R = 45 um.
ACCEPTED: dict[str, dict[str, dict[str, float]]] = {
    "touching": {
        "length": {"exact": 1.7e-3},  # 0.09 %, with other elements 0.06 to 0.13 %; later 0.03 % or less
        "wall_traction": {"accurate": 0.085, "exact": 0.025}},  # at theta = 148: 5.5 and 1.2 %; before 0.7 %
    "bonded": {
        "tip": {"fast": 3e-3, "accurate": 2e-3, "exact": 1.1e-3}}}  # 0.19, 0.14, 0.071 %
CAUSE = {"touching": "just after contact by a cause that is not known, late by 0.01 um in the place of a line",
         "bonded": "elements at the edges of the wall"}
#: (number, theta, preset) that the reference cannot judge: near the edge of a bonded wall its surface turns over.
NOT_JUDGED = {("wall_traction", 1.15, "exact")}
WIDTH = 50.0
#: The lower wall, by kind of states.
WALL = {"touching": "sliding", "bonded": "bonded", "welded": "sliding"}
#: Largest relative errors of a weld's length that presets aim at, and of its tips, written before the errors were seen
#: (2026-11-30).
WELD_AIMS = {"length": {"fast": 1e-2, "accurate": 2e-3, "exact": 5e-4}, "tip": AIMS["tip"]}
#: Accepted errors of the length by preset and theta, since aims are missed while a weld is short. It is too long by
#: 3.37, 0.92 and 0.14 % in `fast`, by 1.22, 0.23 and -0.05 % in `accurate`, and by 1.14, 0.09 and -0.05 % in `exact`,
#: when it is 4.0, 17.3 and 35.2 um long. The first number of `exact` is no error of the mesh: its cause is not known.
WELD_ACCEPTED = {("fast", 98.0): 5e-2, ("fast", 106.0): 1.4e-2, ("accurate", 98.0): 1.9e-2, ("accurate", 106.0): 3.5e-3,
                 ("exact", 98.0): 1.8e-2, ("exact", 106.0): 1.5e-3, ("exact", 122.0): 9e-4}
PRESETS = {preset: (preset,) for preset in runs.QUADRATIC}
NAMES = {"length": "length of contact", "tip": "tips", "wall_traction": "traction of the walls",
         "tensile_stress": "tensile stress"}


@cache
def errors(kind: str, preset: str) -> dict[tuple[str, float, float], float]:
    """Relative errors of a preset by number, radius (um) and theta; of both tips the larger one."""
    by_radius = {}
    for state in gold_growth.states(kind):
        by_radius.setdefault(state.radius, []).append(state)
    found = {}
    for radius, states in by_radius.items():
        scene, reports = grown(kind, preset, radius, [state.theta for state in states])
        for state, report in zip(states, reports):
            for name, computed in numbers(scene, report).items():
                if name in state.numbers:
                    expected = state.numbers[name].value
                    found[name, radius, state.theta] = float(np.abs(np.array(computed) / expected - 1).max())
    return found


def grown(kind: str, preset: str, radius: float, thetas: list[float], *changes: str) -> tuple[Scene, list[Report]]:
    """A scene with a half-disc (radius in um), and its reports after uniform growth to each theta."""
    seed = f'radius="{radius} um"'
    if kind == "welded":
        scene = (f'pore.width="{2 * WIDTH} um"', f'aggregate=[{{{seed}}}, {{{seed}, wall="upper"}}]')
    else:
        scene = (f'pore.width="{WIDTH} um"', f"aggregate.{seed}", 'growth.bonding_strength="1e6 MPa"')
    changes = (runs.with_preset(preset), *scene, f'growth.wall="{WALL[kind]}"', 'kinetics.decay_coefficient="0 1/d"',
               *changes)
    scene = load_scene("base", changes)
    rate, _ = runs.growth_rates(scene.kinetics, scene.substrates)
    hours = [f"{time} h" for time in np.log(thetas) / rate]
    scene = runs.supplied_everywhere(
        load_scene("base", (*changes, f'growth.end="{hours[-1]}"', f"output.times={hours}")))
    return scene, runs.reports_of(scene)


def numbers(scene: Scene, report: Report) -> dict[str, float | tuple[float, float]]:
    """The numbers of :mod:`reference.gold_growth`, and both tips."""
    outline, modulus = report.pore.boundary, scene.growth.shear_modulus
    loading = adhesion.Loading.of(scene)
    return {"length": runs.contact_length(outline, TOP), "tip": (outline.downstream, -outline.upstream),
            "wall_traction": adhesion.wall_peak(loading, report.pore, report.solved).value / modulus,
            "tensile_stress": adhesion.tensile_peak(loading, report.pore, report.solved).value / modulus}


@pytest.mark.slow
@pytest.mark.case(
    "growth-gold-weld", kind="cross-code", references=("gold_growth",), mutants=("weld-slips", "weld-ends-at-corners"),
    omitted="1, paper: aggregates do not join")
@parametrize("preset", PRESETS)
def test_weld(preset, record):
    """Two half-discs that face each other, grow evenly and weld have the weld's length and the tips that NGSolve has.

    Norm: relative errors in three states, the larger of both aggregates.
    """
    states = gold_growth.states("welded")
    _, reports = grown("welded", preset, states[0].radius, [state.theta for state in states])
    for state, report in zip(states, reports):
        outlines = report.pore.outlines
        computed = {"length": [runs.contact_length(outline, WELD) for outline in outlines],
                    "tip": [tip for outline in outlines for tip in (outline.downstream, -outline.upstream)]}
        for name, aims in WELD_AIMS.items():
            error = np.abs(np.array(computed[name]) / state.numbers[name].value - 1).max()
            limit = WELD_ACCEPTED.get((preset, state.theta), aims[preset]) if name == "length" else aims[preset]
            record(judged(state, name, "", error, aims[preset], limit, "its aim is missed while the weld is short"))


def judged(state: gold_growth.Grown, name: str, radius: str, error: float, aim: float, limit: float,
           missed: str) -> Check:
    """The check of an error. Its limit is the aim of the preset, or another one with a reason, ``missed``."""
    expected = state.numbers[name]
    bar = expected.bar / expected.value
    assert bar <= SHARE * aim, f"{name} at {state}: the reference is known to {bar:.1e} only"
    origin = "the aim of the preset" if limit == aim else missed
    return at_most(f"{NAMES[name]}, {radius}theta {state.theta:g}", error, limit + bar,
                   f"{origin}, and the reference's bar")


def judge(kind: str, preset: str, record) -> None:
    """Record the errors of a preset."""
    for state in gold_growth.states(kind):
        for name in state.numbers:
            if name not in AIMS or (name, state.theta, preset) in NOT_JUDGED:
                continue
            aim = AIMS[name][preset]
            limit = ACCEPTED[kind].get(name, {}).get(preset, aim)
            error = errors(kind, preset)[name, state.radius, state.theta]
            record(judged(state, name, f"{state.radius:g} um, ", error, aim, limit,
                          f"the aim of {100 * aim:g} % is missed: {CAUSE[kind]}"))


@pytest.mark.slow
@pytest.mark.case(
    "growth-gold-contact", kind="cross-code", references=("gold_growth",),
    mutants=("half-angle", "lines-on-the-arcs-ahead"),
    omitted="1, paper: nodes join the wall one by one, see growth-contact-lines")
@parametrize("preset", PRESETS)
def test_contact(preset, record):
    """A half-disc that grows evenly into the opposite wall, as a run, has the length of contact, the tips and the
    stresses that NGSolve has.

    Norm: relative errors in four states, from a short length of contact to one that is longer than the pore is wide.
    """
    judge("touching", preset, record)


@pytest.mark.slow
@pytest.mark.case(
    "growth-gold-bonded", kind="cross-code", references=("gold_growth",),
    mutants=("bonded-slides", "traction-at-a-point", "tensile-stress-of-triangles",
             "stresses-on-the-triangles-of-the-run"),
    omitted="1, paper: see coupling-adhesion-balance")
@parametrize("preset", PRESETS)
def test_bonded(preset, record):
    """A half-disc that grows evenly on a wall to which it is bonded has the tips and the stresses that NGSolve has,
    whatever its radius.

    Norm: relative errors for radii from 0.1 to 0.9 of the pore's width.
    """
    judge("bonded", preset, record)
