"""The coupled loop: special cases with a known answer, order in the time step, and what must not matter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from repro import flow, geometry, mesh, pore, transport
from repro.coupling import simulate
from repro.scene import load_scene
from verification import norms
from verification.case import Outcome, Profile, at_least, at_most, case
from verification.convergence import study

ROUND_OFF = "round-off"


def _last(scene):
    """The last instant of a run."""
    *_, last = simulate(scene)
    return last


def _base(end: str, *changes: str):
    return load_scene("base", (f'growth.end="{end}"', f'output.times=["{end}"]', *changes))


def _numbers(instant) -> dict[str, float]:
    """What a run comes to: area (um2), upstream tip (um), conductivity (um/h)."""
    outline, found = instant.pore.outline, instant.solved.flow
    numbers = {"area": outline.area, "upstream tip": outline.upstream}
    return numbers if found is None else {**numbers, "conductivity": found.conductivity}


@case("coupling-uniform-growth", kind="exact",
      norm="relative error of the area; largest deviation of the outline from a half-disc",
      claim="Where diffusion holds the supply everywhere the aggregate stays a half-disc of exactly exp-growing mass",
      mutants=("growth-three-percent-low", "euler-biomass"))
def uniform_growth() -> Outcome:
    scene = _without_flow(_base("6 h"))
    quick = {name: replace(getattr(scene.substrates, name), diffusivity=1e13, diffusivity_in_aggregate=1e13)
             for name in ("acceptor", "donor")}
    scene = replace(scene, substrates=replace(scene.substrates, **quick))
    seed = pore.seeded(scene).outline
    outline = _last(scene).pore.outline
    expected = seed.area * _mass_after(scene, 6.0)
    free = outline.wall == geometry.FREE
    radius = np.hypot(*outline.points[free].T) / np.sqrt(2 * expected / np.pi)
    chord = 1 - np.sqrt(2 * seed.area / np.pi) / scene.aggregate.radius
    return Outcome((at_most("area", abs(outline.area / expected - 1), 1e-5,
                            "J = theta to the stabilisation, and C to 1e-6 of the supply"),
                    at_most("outline", np.abs(radius - 1).max(), 1.5 * chord + 1e-3,
                            "polygon for arc, and linear elements")))


def _without_flow(scene):
    return replace(scene, flow=None)


def _mass_after(scene, time: float) -> float:
    """(X_A + X_I) over that at the start, (9)-(10) at the supply, by hand."""
    law, both = scene.kinetics, scene.substrates
    m_a, m_d = (s.supply / (s.supply + s.half_saturation) for s in (both.acceptor, both.donor))
    rise = m_a * (law.maximum_utilization_rate * law.yield_coefficient * m_d - law.decay_coefficient)
    left = m_a * law.decay_coefficient * (1 - law.degradable_fraction)
    return float(np.exp(rise * time) + left / rise * np.expm1(rise * time))


STEPS = (0.8, 0.4, 0.2, 0.1, 0.05)


@case("coupling-time-step", kind="property",
      norm="difference between a run and that with half the step, relative; base from a seed "
      "of 25 um, 3.2 h, no remesh",
      claim="The loop is of first order in the shape update: the geometry is frozen within a step, the rates are not",
      mutants=("rates-at-the-start",))
def time_step() -> Outcome:
    runs = [_last(_base("3.2 h", 'aggregate.radius="25 um"', f'growth.time_step="{step} h"')) for step in STEPS]
    numbers, studies = [_numbers(run) for run in runs], []
    for name in numbers[0]:
        values = np.array([row[name] for row in numbers])
        apart = np.abs(np.diff(values) / values[-1])
        studies.append(study(name, STEPS[:-1], apart, 1, "frozen geometry: first order", ceiling=1e-3, band=0.15))
    remeshes = sum(run.remeshes for run in runs)
    return Outcome((at_most("remeshes, all runs", remeshes, 0.0, "one mesh: the error in space is common"),),
                   tuple(studies))


@case("coupling-quasi-steady", kind="property", norm="relative difference at 1 h",
      claim="The paper's transient scheme and quasi-steady substrates make the same aggregate: storage over reaction "
            "is 2e-4",
      mutants=("rates-two-percent-low",))
def quasi_steady() -> Outcome:
    ours, theirs = (_numbers(_last(_base("1 h", f'numerics.transport="{name}"'))) for name in ("quasi_steady", "gear"))
    return Outcome(tuple(at_most(name, abs(ours[name] / theirs[name] - 1), 1e-3,
                                 "0.1 %: the transient scheme's accuracy (3.3)")
                         for name in ours))


@case("coupling-extent", kind="property", norm="relative difference at t = 0, refinement 2",
      claim="The central mesh with (6) and (26) beyond it is worth the whole pore",
      mutants=("extent-not-subtracted",))
def extent() -> Outcome:
    checks = []
    for radius in ("5 um", "25 um"):
        central, full = (_solved(f'aggregate.radius="{radius}"', f'numerics.extent="{name}"',
                                 "numerics.refinement=2.0") for name in ("central", "full"))
        for name in central:
            checks.append(at_most(f"{name}, R = {radius}", abs(central[name] / full[name] - 1), 1e-3,
                                  "0.1 %, as between codes; error in space of the whole pore's mesh included"))
    return Outcome(tuple(checks))


def _solved(*changes: str) -> dict[str, float]:
    """Conductivity and effluents of a base scene with changes, at t = 0."""
    scene = load_scene("base", changes)
    now = pore.seeded(scene)
    solved = pore.solve(scene, now)
    leaving = transport.fluxes(solved.problem, now.active, solved.concentrations)
    return {"conductivity": solved.flow.conductivity, "effluent acceptor": leaving[0].effluent,
            "effluent donor": leaving[1].effluent}


@case("coupling-special-cases", kind="property", norm="relative difference, or largest difference over the size",
      claim="lambda = 1 is an empty channel; without growth the pore is fixed; mu_L does not matter without tractions",
      mutants=("tau-jumps",))
def special_cases() -> Outcome:
    grid, _ = mesh.generate(geometry.seed(20.0), (-75.0, 75.0), 50.0, 1.0, 2.0)
    bare = mesh.PoreMesh(grid.points, grid.triangles, np.zeros_like(grid.biomass), np.empty(0, int), grid.width,
                         grid.ends)
    thin, empty = flow.unit_flow(grid, 1.0), flow.unit_flow(bare, 7.0)
    still = _base("1 h", 'kinetics.decay_coefficient="0 1/d"', 'kinetics.maximum_utilization_rate="0 1/d"')
    fixed = [instant.pore.mesh.points for instant in (next(simulate(still)), _last(still))]
    soft, stiff = (_last(_base("1 h", f'growth.shear_modulus="{value} MPa"')).pore.mesh.points for value in (0.001, 10))
    return Outcome((at_most("lambda = 1", np.abs(thin.velocity - empty.velocity).max(), 1e-11, ROUND_OFF),
                    at_most("no growth (um)", np.abs(fixed[0] - fixed[1]).max(), 1e-9, ROUND_OFF),
                    at_most("mu_L times 1e4 (um)", np.abs(soft - stiff).max(), 0.0,
                            "it is nowhere in the equations without tractions")))


@case("coupling-units", kind="property", norm="relative difference at 2 h",
      claim="A pore eight times larger or smaller, with transport to match, grows alike to the last bits: nothing has "
            "a scale of its own",
      mutants=("length-scale",))
def units() -> Outcome:
    scene, checks = _base("2 h"), []
    speed = next(simulate(scene)).solved.flow.mean_velocity
    own = _numbers(_last(_scaled(scene, 1.0, speed)))
    for factor in (8.0, 0.125):
        other = _numbers(_last(_scaled(scene, factor, speed)))
        for name, power in (("area", 2), ("upstream tip", 1), ("conductivity", 2)):
            checks.append(at_most(f"{name}, lengths times {factor:g}",
                                  abs(other[name] / own[name] / factor**power - 1), 1e-12,
                                  "powers of two are exact: even the mesher does the same"))
    return Outcome(tuple(checks))


def _scaled(scene, factor: float, speed: float):
    """The scene with lengths times a factor, diffusivities times its square, times as they are."""
    spread = {name: replace(s, diffusivity=factor**2 * s.diffusivity,
                            diffusivity_in_aggregate=factor**2 * s.diffusivity_in_aggregate)
              for name, s in (("acceptor", scene.substrates.acceptor), ("donor", scene.substrates.donor))}
    return replace(scene, pore=replace(scene.pore, width=factor * scene.pore.width, length=factor * scene.pore.length),
                   aggregate=replace(scene.aggregate, radius=factor * scene.aggregate.radius),
                   flow=replace(scene.flow, head=None, mean_velocity=factor * speed),
                   substrates=replace(scene.substrates, **spread),
                   growth=replace(scene.growth, minimum_film=factor * scene.growth.minimum_film))


@case("coupling-mirror", kind="property",
      norm="difference of the tips' distances from the origin, and of C_A left and right, relative",
      claim="Without flow an aggregate grows alike to both sides",
      mutants=("one-end-held", "fixed-beside-the-middle"))
def mirror() -> Outcome:
    last = _last(_without_flow(_base("8 h")))
    outline, grid = last.pore.outline, last.pore.mesh
    tips = abs(outline.downstream + outline.upstream) / outline.downstream
    x = np.linspace(1.0, 70.0, 70)
    sides = [norms.sample(grid.points, grid.triangles, last.solved.concentrations.acceptor,
                          np.column_stack([s * x, 0.3 + 0 * x]))
             for s in (-1, 1)]
    profile = Profile("C_A along the lower wall, 8 h", "|x| (um)", "C_A (mg/L)",
                      (("upstream", "ours", x, sides[0]), ("downstream", "reference", x, sides[1])))
    return Outcome((at_most("tips", tips, 1e-3, "unsymmetric mesh"),
                    at_most("C_A", np.abs(sides[0] - sides[1]).max() / 10.0, 1e-4, "unsymmetric mesh"),
                    at_least("it has grown (area over the seed's)", outline.area / 39.27, 2.0,
                             "else nothing is tested")), (), (profile,))
