"""The averaged pore of :mod:`reference.averaged_pore` for a scene, and how far a run is from it."""

from __future__ import annotations

import numpy as np

from reference import averaged_pore
from repro import results
from repro.march.loop import Instant
from repro.march.simulation import simulate
from repro.model import pore
from repro.scene import Scene
from verification.kernel.case import Profile
from verification.problems import runs

#: um/h in m/d.
M_PER_D = 24e-6
#: Cells of the averaged pore: of the aggregate, and on each side of it.
CELLS, FLUID = 30, 90
#: Sections of a mesh at which means are compared.
PLACES = 81


def pore_of(scene: Scene, speed=None) -> averaged_pore.Pore:
    """The scene's numbers; speed: (loss, half length) -> u, the scene's mean velocity if none."""
    law, both, drive = scene.kinetics, scene.substrates, scene.flow
    rates = {"k": law.maximum_utilization_rate, "F": law.acceptor_to_donor_ratio, "Y": law.yield_coefficient,
             "b": law.decay_coefficient, "remains": law.decay_coefficient * (1 - law.degradable_fraction),
             "decay": law.decay_oxygen_demand * law.degradable_fraction * law.decay_coefficient,
             "K_A": both.acceptor.half_saturation, "K_D": both.donor.half_saturation}

    def pair(name):
        return getattr(both.acceptor, name), getattr(both.donor, name)

    return averaged_pore.Pore(scene.pore.width, scene.pore.length, drive.viscosity_ratio, pair("supply"),
                              pair("diffusivity"), pair("diffusivity_in_aggregate"), law.maximum_density, rates,
                              speed or (lambda loss, reach: drive.mean_velocity))


def half_disc_radius(area: float) -> float:
    """Of the half-disc of an area: the meshed one is a polygon."""
    return float(np.sqrt(2 * area / np.pi))


def half_disc(scene: Scene, speed=None, cells: int = CELLS, fluid: int = FLUID) -> averaged_pore.Averaged:
    """The averaged run of a half-disc of the area that the meshed seed has."""
    radius = half_disc_radius(pore.seeded(scene).outline.area)
    return averaged_pore.Averaged(pore_of(scene, speed), *averaged_pore.half_ellipse(radius, radius, cells), fluid,
                                  keeps_shape=True)


def ours(scene: Scene) -> list[Instant]:
    """The reported instants of a run after t = 0."""
    return list(simulate(scene))[1:]


def apart(scene: Scene, instant: Instant, moment: averaged_pore.Moment) -> dict[str, float]:
    """Ours less the averaged pore's: area and velocity relative to the latter's, effluents (the further of both) and
    section means of C (the largest difference along the mesh) over the supply."""
    row, supply = results.row(scene, instant), scene.substrates.acceptor.supply
    effluents = np.array([row[f"effluent_{name}_mg_per_L"] for name in ("acceptor", "donor")])
    x, means = profile(instant)
    between = [np.interp(x, moment.x, field) for field in moment.fields]
    return {"area": row["aggregate_area_um2"] / moment.area - 1,
            "velocity": row["mean_velocity_m_per_d"] / M_PER_D / moment.velocity - 1,
            "effluents": float(np.abs(effluents - moment.fields[:, -1]).max()) / supply,
            "C along the pore": float(np.abs(means - between).max()) / supply}


def profile(instant: Instant) -> tuple[np.ndarray, np.ndarray]:
    """(x, section means (2, K)) over the mesh."""
    x = np.linspace(*instant.pore.mesh.ends, PLACES)
    return x, runs.section_means(instant.pore, instant.solved, x)


def worst(rows: list[dict[str, float]]) -> dict[str, float]:
    """The largest size of each number."""
    return {name: max(abs(row[name]) for row in rows) for name in rows[0]}


def profiles(instants: list[Instant], moments) -> tuple[Profile, ...]:
    """Section means along the mesh, a picture a substrate: ours, and the averaged pore's."""
    pictures = []
    for k, name in enumerate(("C_A", "C_D")):
        curves = []
        for instant, moment in zip(instants, moments):
            x, means = profile(instant)
            within = (moment.x > x[0]) & (moment.x < x[-1])
            curves += [(f"{instant.pore.time:g} h", "ours", x, means[k]),
                       (f"averaged, {instant.pore.time:g} h", "reference", moment.x[within], moment.fields[k, within])]
        pictures.append(Profile(f"section means of {name}", "x (um)", f"{name} (mg/L)", tuple(curves)))
    return tuple(pictures)
