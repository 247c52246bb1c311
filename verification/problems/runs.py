"""Runs that cases share, their results, and the averaged pore of :mod:`reference.averaged_pore`."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import fields, is_dataclass, replace
from operator import itemgetter
from typing import TYPE_CHECKING

import numpy as np

from reference import whole_run
from repro import results
from repro.fem.outline import Outline
from repro.fem.walls import TOP
from repro.march import midpoint, updates
from repro.march.balance import Ledger
from repro.march.simulation import simulate
from repro.march.state import Report, StepResult
from repro.model.meshing import seeded
from repro.model.pore import Pore
from repro.model.solving import Solved
from repro.model.stages import Stages
from repro.scene import Kinetics, Scene, Substrates
from verification.evidence.checks import columns
from verification.problems import channels, meshes
from verification.problems.schemes import Change, Exchange, exchange, load_scene

if TYPE_CHECKING:
    from reference import averaged_pore

ROUND_OFF = "round-off"
#: The velocity of base at t = 0, 2.9 m/d, in um/h.
SPEED = 2.9e6 / 24
#: Elements of order 1 and 2, by their names in scenes.
ELEMENTS = ("linear", "quadratic")


def with_elements(elements: str) -> Exchange:
    """The change of a scene that sets its elements: linear or quadratic."""
    return exchange(elements=elements)


def coarser(elements: str, refinement: float, linear: float = 1.0) -> str:
    """The change of a scene that sets the refinement of quadratic elements, or that of linear ones."""
    return f"numerics.refinement={linear if elements == 'linear' else refinement}"


def with_preset(preset: str) -> str:
    """The change of a scene that sets its preset."""
    return f'numerics.preset="{preset}"'


PRESETS = ("paper", "fast", "accurate")
#: Presets with quadratic elements and the midpoint rule.
QUADRATIC = ("fast", "accurate", "exact")
#: Changes of a scene, by label: the presets.
NUMERICS = {preset: (with_preset(preset),) for preset in PRESETS}
WITH_EXACT = {**NUMERICS, "exact": (with_preset("exact"),)}


def kinds(refinement: float, linear: float = 1.0) -> dict[str, tuple[Change, ...]]:
    """Changes of a scene, by label: every kind of elements with the paper's scheme and a refinement."""
    return {kind: (with_elements(kind), coarser(kind, refinement, linear)) for kind in ELEMENTS}


def every(refinement: float, linear: float = 1.0) -> dict[str, tuple[Change, ...]]:
    """:func:`kinds` and the presets."""
    return {**kinds(refinement, linear), **{preset: (with_preset(preset),) for preset in QUADRATIC}}


EVERY = every(0.4)


def base(end: str, *changes: Change, times: Iterable[float] = ()) -> Scene:
    """The paper's scene to a time ("6 h"), reported at its end, or at ``times`` (h)."""
    rows = [f"{time} h" for time in times] or [end]
    return load_scene("base", (f'growth.end="{end}"', f"output.times={rows}", *changes))


def standing(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """(n, 2) um, points of an outline. The first and the last are on the lower wall to the last bit."""
    return np.column_stack([x, np.concatenate([[0.0], y[1:-1], [0.0]])])


def step(scene: Scene, pore: Pore, solved: Solved, hours: float) -> StepResult:
    """A step by the scene's scheme. A step of the midpoint rule is accepted whatever its error estimate."""
    if not scene.numerics.scheme.controls_error:
        return updates.step(Stages.of(scene), pore, solved, hours)
    return midpoint.attempt(Stages.of(scene), pore, solved, hours).step


def shape_of(scene: Scene, pore: Pore, grown: Pore) -> Pore:
    """The shape of grown biomass, (28)-(34), on the mesh of the previous shape."""
    return Stages.of(scene).expand(pore, grown).pore


def next_shape(scene: Scene, pore: Pore, solved: Solved, hours: float) -> Pore:
    """The shape after an update of so many hours."""
    grown, _, _ = Stages.of(scene).transport.make_biomass(pore, solved, hours)
    return shape_of(scene, pore, grown)


def last(scene: Scene) -> Report:
    """The last instant of a run."""
    *_, report = simulate(scene)
    return report


def numbers(instant: Report) -> dict[str, float]:
    """Area (um2), upstream tip (um) and conductivity (um/h) at an instant."""
    outline = instant.pore.outline
    return {"area": outline.area, "upstream tip": outline.upstream,
            "conductivity": instant.solved.flow.conductivity}


def contact_length(outline: Outline, wall: int) -> float:
    """Length (um) of the contact surface with a wall; zero without contact."""
    x = outline.points[outline.wall == wall, 0]
    return float(np.ptp(x)) if len(x) else 0.0


def after_contact(instant: Report) -> dict[str, float]:
    """Conductivity, tips, and the length of contact with the opposite wall at an instant."""
    outline = instant.pore.boundary
    return {"conductivity (m/d)": M_PER_D * instant.solved.flow.conductivity, "upstream tip (um)": outline.upstream,
            "downstream tip (um)": outline.downstream, "length of contact (um)": contact_length(outline, TOP)}


def without_flow(scene: Scene) -> Scene:
    """The scene with diffusion alone and the supply at both ends."""
    return replace(scene, flow=None)


def at_velocity(scene: Scene, speed: float) -> Scene:
    """The scene with a mean velocity (um/h) instead of its head."""
    return replace(scene, flow=replace(scene.flow, head=None, mean_velocity=speed))


def with_diffusivities(scene: Scene, change) -> Scene:
    """The scene with ``change``: (D, D_B) -> (D, D_B) applied to both substrates."""
    changed = {}
    for name in channels.NAMES:
        one = getattr(scene.substrates, name)
        water, biomass = change(one.diffusivity, one.diffusivity_in_aggregate)
        changed[name] = replace(one, diffusivity=water, diffusivity_in_aggregate=biomass)
    return replace(scene, substrates=replace(scene.substrates, **changed))


def faster(scene: Scene, factor: float) -> Scene:
    """The scene at the velocity of base, with its diffusivities times a factor."""
    spread = with_diffusivities(scene, lambda water, biomass: (factor * water, factor * biomass))
    return at_velocity(spread, SPEED)


def supplied_everywhere(scene: Scene) -> Scene:
    """The scene without flow and with a diffusivity of at least a million times D_A, so that C is the supply
    everywhere."""
    return with_diffusivities(without_flow(scene), lambda water, biomass: (1e13, 1e13))


#: Powers of length and time in the units of keys.
UNITS = {"um": (1, 0), "um^2": (2, 0), "um/h": (1, -1), "um/h^2": (1, -2), "um^2/h": (2, -1), "1/h": (0, -1),
         "h": (0, 1)}


def scaled(section, length: float, time: float):
    """A scene, or a section of it, with its units of length and time multiplied by factors."""
    changes = {}
    for key in fields(section):
        value, kind = getattr(section, key.name), key.metadata.get("kind")
        along, during = UNITS.get(getattr(kind, "unit", ""), (0, 0))
        if is_dataclass(value):
            changes[key.name] = scaled(value, length, time)
        elif isinstance(value, tuple) and value and is_dataclass(value[0]):
            changes[key.name] = tuple(scaled(each, length, time) for each in value)
        elif key.name == "times" and value:
            changes[key.name] = tuple(time * t for t in value)
        elif (along or during) and value is not None:
            changes[key.name] = value * length**along * time**during
    return replace(section, **changes)


def density(scene: Scene, pore: Pore) -> np.ndarray:
    """(r, q) (X_A + X_I) / X_m in the points of the reaction."""
    return (pore.active + pore.inert) / pore.space.reaction.dx / scene.kinetics.maximum_density


def density_drift(scene: Scene, instant: Report) -> float:
    """Largest |(X_A + X_I) / X_m - 1|."""
    return np.abs(density(scene, instant.pore) - 1).max()


def section_means(pore: Pore, solved: Solved, x: np.ndarray) -> np.ndarray:
    """(2, K) means of C_A and C_D over the sections x (K,) of the mesh."""
    return meshes.section_means(pore.space, channels.both(solved.concentrations).T, x).T


def growth_rates(law: Kinetics, both: Substrates, acceptor: float | None = None, donor: float | None = None
                 ) -> tuple[float, float]:
    """Rates (1/h) at which X_A grows and leaves X_I, (9)-(10), by formulas independent of the package.

    acceptor, donor: concentrations (mg/L), by default the supplies.
    """
    pairs = ((both.acceptor.supply if acceptor is None else acceptor, both.acceptor.half_saturation),
             (both.donor.supply if donor is None else donor, both.donor.half_saturation))
    m_a, m_d = (value / (value + half) for value, half in pairs)
    return (m_a * (law.maximum_utilization_rate * law.yield_coefficient * m_d - law.decay_coefficient),
            m_a * law.decay_coefficient * (1 - law.degradable_fraction))


def substrate_defect(steps: Sequence[Ledger]) -> float:
    """Largest defect of the balances of both substrates in some steps, over the supplied mass."""
    return np.max([np.abs(np.array(step.supplied) - step.out - step.consumed - step.stored) / step.supplied
                   for step in steps])


def biomass_defect(steps: Sequence[Ledger]) -> float:
    """Largest defect of the balance of biomass in some steps, over the biomass after a step."""
    return np.max([abs(step.biomass_after - step.biomass_before - step.biomass_made) / step.biomass_after
                   for step in steps])


def worth(law: Kinetics, step: Ledger) -> tuple[float, float]:
    """Biomass that the uptake of a step makes, Y donor, and that decays with it, (acceptor - F donor) / d_c."""
    acceptor, donor = step.consumed
    return law.yield_coefficient * donor, (acceptor - law.acceptor_to_donor_ratio * donor) / law.decay_oxygen_demand


def mass_after(scene: Scene, time: float, acceptor: float | None = None) -> float:
    """X_A + X_I after a time (h) over the initial value, for exponential growth at the supply or at another acceptor
    (mg/L)."""
    rise, left = growth_rates(scene.kinetics, scene.substrates, acceptor)
    return np.exp(rise * time) + left / rise * np.expm1(rise * time)


#: um/h in m/d, independent of the package.
M_PER_D = 24e-6
#: Cells of the averaged pore's aggregate.
CELLS = 30
#: Sections of a mesh at which means are compared.
SECTIONS = 81


def pore_of(scene: Scene, speed=None) -> averaged_pore.Pore:
    """The averaged pore of a scene. speed: (loss, half length) -> u, by default the mean velocity of the scene."""
    from reference import averaged_pore  # FiPy, which figures do not need

    law = scene.kinetics
    both = scene.substrates
    drive = scene.flow
    rates = {**channels.rates(law, both), "Y": law.yield_coefficient, "b": law.decay_coefficient,
             "remains": law.decay_coefficient * (1 - law.degradable_fraction)}
    both_of = (channels.pair(name, both) for name in ("supply", "diffusivity", "diffusivity_in_aggregate"))
    return averaged_pore.Pore(scene.pore.width, scene.pore.length, drive.viscosity_ratio, *both_of, law.maximum_density,
                              rates, speed or (lambda loss, reach: drive.mean_velocity))


def half_disc_radius(area: float) -> float:
    """Radius of the half-disc with an area. The meshed one is a polygon."""
    return np.sqrt(2 * area / np.pi)


def half_disc(scene: Scene, speed=None, cells: int = CELLS) -> averaged_pore.Averaged:
    """The averaged run of a half-disc with the area of the meshed seed. Each side has three times as many cells."""
    from reference import averaged_pore

    radius = half_disc_radius(seeded(scene).outline.area)
    return averaged_pore.Averaged(pore_of(scene, speed), *averaged_pore.half_ellipse(radius, radius, cells), 3 * cells)


def reports_of(scene: Scene) -> list[Report]:
    """The reported instants of a run after t = 0."""
    return list(simulate(scene))[1:]


#: The numbers of base as :mod:`reference.whole_run` lists them.
EIGHT = ("mean_velocity_m_per_d", "conductivity_m_per_d", "aggregate_area_um2", "thickness_um", "upstream_um",
         "downstream_um", "effluent_acceptor_mg_per_L", "effluent_donor_mg_per_L")


def values(times: Sequence[float], *changes: Change) -> np.ndarray:
    """(times, 8) values of EIGHT in the table of a run of base, at some times (h). The last is the end."""
    scene = base(f"{times[-1]} h", *changes, times=times)
    return np.array([itemgetter(*EIGHT)(results.row(scene, instant)) for instant in reports_of(scene)])


def errors(computed: np.ndarray, expected: np.ndarray) -> np.ndarray:
    """(times, 8) differences of EIGHT: relative, those of effluents over the supply."""
    scale = np.abs(expected)
    scale[:, 6:] = whole_run.Pore().supply
    return np.abs(computed - expected) / scale


def differences(scene: Scene, instants: list[Report], moments) -> dict[str, float]:
    """Largest differences from the averaged pore at the reported times.

    Those of area and velocity are relative. Those of effluents (the larger of both) and of section means of C along
    the mesh are over the supply.
    """
    return worst([_differences_at(scene, *pair) for pair in zip(instants, moments)])


def _differences_at(scene: Scene, instant: Report, moment: averaged_pore.AveragedState) -> dict[str, float]:
    row, supply = results.row(scene, instant), scene.substrates.acceptor.supply
    effluents = np.array([row[f"effluent_{name}_mg_per_L"] for name in channels.NAMES])
    computed, expected = along(instant.pore, instant.solved, moment)
    return {"area": row["aggregate_area_um2"] / moment.area - 1,
            "velocity": row["mean_velocity_m_per_d"] / M_PER_D / moment.velocity - 1,
            "effluents": np.abs(effluents - moment.fields[:, -1]).max() / supply,
            "C along the pore": np.abs(computed - expected).max() / supply}


def along(pore: Pore, solved: Solved, moment: averaged_pore.AveragedState) -> tuple[np.ndarray, np.ndarray]:
    """(2, SECTIONS) section means of C_A and C_D along the mesh, and those of the averaged pore."""
    x = np.linspace(*pore.mesh.ends, SECTIONS)
    return section_means(pore, solved, x), np.array([np.interp(x, moment.x, field) for field in moment.fields])


def worst(rows: list[dict[str, float]]) -> dict[str, float]:
    """The largest size of each number."""
    return {name: np.abs(values).max() for name, values in columns(rows).items()}
