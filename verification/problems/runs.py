"""Runs that cases share, what is read off them, and the averaged pore of :mod:`reference.averaged_pore` beside them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import fields, is_dataclass, replace
from operator import itemgetter

import numpy as np

from reference import averaged_pore, whole_run
from repro import results
from repro.march import midpoint, updates
from repro.march.loop import Instant, Ledger, Step
from repro.march.simulation import simulate
from repro.model import contact, pore
from repro.model.pore import Pore, Solved
from repro.scene import Kinetics, Scene, Substrates, load_scene
from verification.evidence.checks import columns
from verification.problems import channels, meshes

ROUND_OFF = "round-off"
#: The velocity of base at t = 0, 2.9 m/d, in um/h.
SPEED = 2.9e6 / 24
#: Kinds of elements, by the names that scenes have for them: of order 1, 2 and 3.
ELEMENTS = ("linear", "quadratic", "cubic")


def of(elements: str) -> str:
    """The change of a scene that makes its elements linear, quadratic or cubic."""
    return f'numerics.elements="{elements}"'


def coarser(elements: str, refinement: float, linear: float = 1.0) -> str:
    """The change of a scene that gives quadratic and cubic elements a refinement, and linear ones another."""
    return f"numerics.refinement={linear if elements == 'linear' else refinement}"


def by(preset: str) -> str:
    """The change of a scene that makes its numerics those of a preset."""
    return f'numerics.preset="{preset}"'


PRESETS = ("paper", "fast", "accurate")
#: Those of quadratic elements and the midpoint rule.
QUADRATIC = ("fast", "accurate", "exact")
#: Changes of a scene, by label: the presets, and fast with cubic elements.
NUMERICS = {**{preset: (by(preset),) for preset in PRESETS}, "cubic": (by("fast"), of("cubic"))}
WITH_EXACT = {**NUMERICS, "exact": (by("exact"),)}


def kinds(refinement: float, linear: float = 1.0) -> dict[str, tuple[str, ...]]:
    """Changes of a scene, by label: every kind of elements with the paper's scheme, refined so."""
    return {kind: (of(kind), coarser(kind, refinement, linear)) for kind in ELEMENTS}


def every(refinement: float, linear: float = 1.0) -> dict[str, tuple[str, ...]]:
    """The same, and the presets."""
    return {**kinds(refinement, linear), **{preset: (by(preset),) for preset in QUADRATIC}}


EVERY = every(0.4)


def base(end: str, *changes: str, times: Iterable[float] = ()) -> Scene:
    """The paper's scene to a time ("6 h"), reported at its end, or at ``times`` (h)."""
    rows = [f"{time} h" for time in times] or [end]
    return load_scene("base", (f'growth.end="{end}"', f"output.times={rows}", *changes))


def standing(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """(n, 2) um, a shape's points with the first and the last on the lower wall to the last bit."""
    return np.column_stack([x, np.concatenate([[0.0], y[1:-1], [0.0]])])


def step(scene: Scene, now: Pore, solved: Solved, hours: float) -> Step:
    """A step by the scene's ``numerics.time``; of the midpoint rule, whatever its estimate."""
    if scene.numerics.time == "updates":
        return updates.step(scene, now, solved, hours)
    return midpoint.attempt(scene, now, solved, hours).step


def shape_of(scene: Scene, now: Pore, grown: Pore) -> Pore:
    """The shape that biomass takes when it has grown, (28)-(34), on the mesh as it was."""
    return contact.expand(scene, grown, updates.enlarged(scene, now, grown)).pore


def next_shape(scene: Scene, now: Pore, solved: Solved, hours: float) -> Pore:
    """That after an update of so many hours."""
    grown, _, _ = updates.make_biomass(scene, now, solved, hours)
    return shape_of(scene, now, grown)


def last(scene: Scene) -> Instant:
    """The last instant of a run."""
    *_, found = simulate(scene)
    return found


def numbers(instant: Instant) -> dict[str, float]:
    """What a run comes to: area (um2), upstream tip (um), conductivity (um/h)."""
    outline = instant.pore.outline
    return {"area": outline.area, "upstream tip": outline.upstream,
            "conductivity": instant.solved.flow.conductivity}


def without_flow(scene: Scene) -> Scene:
    """The supply held at both ends, and diffusion alone."""
    return replace(scene, flow=None)


def at_velocity(scene: Scene, speed: float) -> Scene:
    """The scene driven by a mean velocity (um/h) instead of its head."""
    return replace(scene, flow=replace(scene.flow, head=None, mean_velocity=speed))


def with_diffusivities(scene: Scene, change) -> Scene:
    """The scene with ``change`` (D, D_B) -> (D, D_B) made to both substrates."""
    changed = {}
    for name in channels.NAMES:
        one = getattr(scene.substrates, name)
        water, biomass = change(one.diffusivity, one.diffusivity_in_aggregate)
        changed[name] = replace(one, diffusivity=water, diffusivity_in_aggregate=biomass)
    return replace(scene, substrates=replace(scene.substrates, **changed))


def faster(scene: Scene, factor: float) -> Scene:
    """The scene at base's velocity with diffusivities so many times its own."""
    spread = with_diffusivities(scene, lambda water, biomass: (factor * water, factor * biomass))
    return at_velocity(spread, SPEED)


def supplied_everywhere(scene: Scene) -> Scene:
    """The scene without flow, diffusion a million times D_A and more: the supply everywhere."""
    return with_diffusivities(without_flow(scene), lambda water, biomass: (1e13, 1e13))


#: Powers of length and time in the units of keys.
UNITS = {"um": (1, 0), "um^2": (2, 0), "um/h": (1, -1), "um/h^2": (1, -2), "um^2/h": (2, -1), "1/h": (0, -1),
         "h": (0, 1)}


def scaled(section, length: float, time: float):
    """A scene, or a section of it, with its unit of length and of time so many times larger."""
    changes = {}
    for key in fields(section):
        value, kind = getattr(section, key.name), key.metadata.get("kind")
        along, during = UNITS.get(getattr(getattr(kind, "whole", kind), "unit", ""), (0, 0))
        if is_dataclass(value):
            changes[key.name] = scaled(value, length, time)
        elif key.name == "times" and value:
            changes[key.name] = tuple(time * t for t in value)
        elif (along or during) and value is not None:
            changes[key.name] = value * length**along * time**during
    return replace(section, **changes)


def density(scene: Scene, now: Pore) -> np.ndarray:
    """(r, q) (X_A + X_I) / X_m in the points of the reaction."""
    return (now.active + now.inert) / now.space.reaction.dx / scene.kinetics.maximum_density


def density_drift(scene: Scene, instant: Instant) -> float:
    """Its largest distance from one."""
    return np.abs(density(scene, instant.pore) - 1).max()


def section_means(now: Pore, solved: Solved, x: np.ndarray) -> np.ndarray:
    """(2, K) means of C_A and C_D over the sections x (K,) of the mesh."""
    return meshes.section_means(now.space, channels.both(solved.concentrations).T, x).T


def growth_rates(law: Kinetics, both: Substrates, acceptor: float | None = None, donor: float | None = None
                 ) -> tuple[float, float]:
    """Rates (1/h) at which X_A grows and leaves X_I, (9)-(10), at concentrations (mg/L), those of the supply by
    default: written down anew."""
    given = ((both.acceptor.supply if acceptor is None else acceptor, both.acceptor.half_saturation),
             (both.donor.supply if donor is None else donor, both.donor.half_saturation))
    m_a, m_d = (value / (value + half) for value, half in given)
    return (m_a * (law.maximum_utilization_rate * law.yield_coefficient * m_d - law.decay_coefficient),
            m_a * law.decay_coefficient * (1 - law.degradable_fraction))


def substrate_defect(steps: Sequence[Ledger]) -> float:
    """What the balances of both substrates miss at most in some steps, over what is supplied."""
    return np.max([np.abs(np.array(step.supplied) - step.out - step.consumed - step.stored) / step.supplied
                   for step in steps])


def biomass_defect(steps: Sequence[Ledger]) -> float:
    """The same of biomass, over that after a step."""
    return np.max([abs(step.biomass_after - step.biomass_before - step.biomass_made) / step.biomass_after
                   for step in steps])


def worth(law: Kinetics, step: Ledger) -> tuple[float, float]:
    """What the substrates taken up in a step are worth in biomass: Y times the donor, and what decays, the acceptor
    beyond F times the donor, over d_c."""
    acceptor, donor = step.consumed
    return law.yield_coefficient * donor, (acceptor - law.acceptor_to_donor_ratio * donor) / law.decay_oxygen_demand


def mass_after(scene: Scene, time: float, acceptor: float | None = None) -> float:
    """(X_A + X_I) over that at the start, after hours at the supply, or at another acceptor: an exponential."""
    rise, left = growth_rates(scene.kinetics, scene.substrates, acceptor)
    return np.exp(rise * time) + left / rise * np.expm1(rise * time)


#: um/h in m/d.
M_PER_D = 24e-6
#: Cells of the averaged pore's aggregate.
CELLS = 30
#: Sections of a mesh at which means are compared.
PLACES = 81


def pore_of(scene: Scene, speed=None) -> averaged_pore.Pore:
    """The scene's numbers; speed: (loss, half length) -> u, the scene's mean velocity if none."""
    law = scene.kinetics
    both = scene.substrates
    drive = scene.flow
    rates = {**channels.rates(law, both), "Y": law.yield_coefficient, "b": law.decay_coefficient,
             "remains": law.decay_coefficient * (1 - law.degradable_fraction)}
    both_of = (channels.pair(name, both) for name in ("supply", "diffusivity", "diffusivity_in_aggregate"))
    return averaged_pore.Pore(scene.pore.width, scene.pore.length, drive.viscosity_ratio, *both_of, law.maximum_density,
                              rates, speed or (lambda loss, reach: drive.mean_velocity))


def half_disc_radius(area: float) -> float:
    """Of the half-disc of an area: the meshed one is a polygon."""
    return np.sqrt(2 * area / np.pi)


def half_disc(scene: Scene, speed=None, cells: int = CELLS) -> averaged_pore.Averaged:
    """The averaged run of a half-disc of the area that the meshed seed has; three times as many cells on each side."""
    radius = half_disc_radius(pore.seeded(scene).outline.area)
    return averaged_pore.Averaged(pore_of(scene, speed), *averaged_pore.half_ellipse(radius, radius, cells), 3 * cells,
                                  keeps_shape=True)


def ours(scene: Scene) -> list[Instant]:
    """The reported instants of a run after t = 0."""
    return list(simulate(scene))[1:]


#: The numbers of base as :mod:`reference.whole_run` lists them.
EIGHT = ("mean_velocity_m_per_d", "conductivity_m_per_d", "aggregate_area_um2", "thickness_um", "upstream_um",
         "downstream_um", "effluent_acceptor_mg_per_L", "effluent_donor_mg_per_L")


def values(times: Sequence[float], *changes: str) -> np.ndarray:
    """(times, 8) of EIGHT of the table that a run of base writes, at some times (h), the last of them its end."""
    scene = base(f"{times[-1]} h", *changes, times=times)
    return np.array([itemgetter(*EIGHT)(results.row(scene, instant)) for instant in ours(scene)])


def errors(found: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """(times, 8) differences of EIGHT: relative, of effluents over the supply."""
    scale = np.abs(truth)
    scale[:, 6:] = whole_run.Pore().supply
    return np.abs(found - truth) / scale


def apart(scene: Scene, instants: list[Instant], moments) -> dict[str, float]:
    """The largest differences from the averaged pore at the reported times: of area and velocity relative to the
    latter's, of effluents (the further of both) and of section means of C (along the mesh) over the supply."""
    return worst([_less(scene, *pair) for pair in zip(instants, moments)])


def _less(scene: Scene, instant: Instant, moment: averaged_pore.Moment) -> dict[str, float]:
    row, supply = results.row(scene, instant), scene.substrates.acceptor.supply
    effluents = np.array([row[f"effluent_{name}_mg_per_L"] for name in channels.NAMES])
    here, there = along(instant.pore, instant.solved, moment)
    return {"area": row["aggregate_area_um2"] / moment.area - 1,
            "velocity": row["mean_velocity_m_per_d"] / M_PER_D / moment.velocity - 1,
            "effluents": np.abs(effluents - moment.fields[:, -1]).max() / supply,
            "C along the pore": np.abs(here - there).max() / supply}


def along(now: Pore, solved: Solved, moment: averaged_pore.Moment) -> tuple[np.ndarray, np.ndarray]:
    """(2, PLACES) section means of C_A and C_D along the mesh, and those of the averaged pore."""
    x = np.linspace(*now.mesh.ends, PLACES)
    return section_means(now, solved, x), np.array([np.interp(x, moment.x, field) for field in moment.fields])


def worst(rows: list[dict[str, float]]) -> dict[str, float]:
    """The largest size of each number."""
    return {name: np.abs(values).max() for name, values in columns(rows).items()}
