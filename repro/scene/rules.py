"""What keys of a scene ask of each other."""
from collections.abc import Iterator
from importlib.util import find_spec
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from repro.scene import Pore, Scene

_UNSTEADY = ', or numerics.transport = "gear": nothing is supplied, so that no state is steady'
MOST_STEPS = 100_000  # shape updates of a run
SHORTEST_STEP = 1e-6  # h: times are told apart to 1e-9 h
#: What only linear elements have a choice of, and what the others have.
HIGHER_ORDER = {"transfer": "conserving", "flow_element": "stabilised"}

Rules = Iterator[tuple[bool, str, str]]  # (is it broken, the key to name, what is accepted)


def rules(scene: "Scene") -> Rules:
    """What is accepted of each key in the light of the others."""
    if scene.aggregate:
        yield from _seed_rules(scene.aggregate.radius, scene.pore)
    if scene.flow:
        yield from _flow_rules(scene, scene.flow.head, scene.flow.mean_velocity)
    if scene.substrates:
        yield from _boundary_rules(scene)
    yield from _growth_rules(scene)
    yield from _numerics_rules(scene)
    yield from _output_rules(scene)


def _seed_rules(radius: float, pore: "Pore") -> Rules:
    wanted = f"less than pore.width ({pore.width:g} um) and half of pore.length ({pore.length:g} um) is needed"
    yield radius >= pore.width or 2 * radius >= pore.length, "aggregate.radius", wanted
    wanted = f"a thousandth of pore.width ({pore.width:g} um) or more is needed"
    yield radius < pore.width / 1000, "aggregate.radius", wanted


def _flow_rules(scene: "Scene", head: float | None, velocity: float | None) -> Rules:
    wanted = 'it or flow.mean_velocity is needed, such as head = "1e-3 cm" or mean_velocity = "2.9 m/day"'
    yield head is None and velocity is None, "flow.head", wanted
    wanted = f"flow.head ({head} um) is given too; one of them is accepted, not both"
    yield head is not None and velocity is not None, "flow.mean_velocity", wanted
    wanted = f"greater than zero is needed{_UNSTEADY}"
    yield velocity == 0 and scene.substrates is not None and _steady(scene), "flow.mean_velocity", wanted


def _boundary_rules(scene: "Scene") -> Rules:
    closed = scene.substrates.boundary == "closed"
    yield closed and scene.flow is not None, "substrates.boundary", '"open" is needed with [flow]'
    yield closed and _steady(scene), "substrates.boundary", f'"open" is needed{_UNSTEADY}'


def _growth_rules(scene: "Scene") -> Rules:
    alone, wanted = not (scene.substrates and scene.aggregate), "[aggregate] and [substrates] are needed with it"
    yield alone and scene.kinetics is not None, "kinetics", wanted
    yield alone and scene.growth is not None, "growth", wanted
    if scene.growth:
        wanted = f"growth.end ({scene.growth.end:g} h) over {MOST_STEPS} or more is needed"
        yield scene.growth.time_step < SHORTEST_STEP, "growth.time_step", f"{SHORTEST_STEP:g} h or more is needed"
        yield scene.growth.end > MOST_STEPS * scene.growth.time_step, "growth.time_step", wanted
    if scene.growth and scene.growth.fluid_forces == "included":
        yield from _force_rules(scene)
    film, width = scene.growth.minimum_film if scene.growth else 0.0, scene.pore.width
    yield film >= width, "growth.minimum_film", f"less than pore.width ({width:g} um) is needed"


def _force_rules(scene: "Scene") -> Rules:
    wanted = '"neglected" is needed without [flow]'
    yield scene.flow is None, "growth.fluid_forces", wanted
    wanted = '"neglected" is needed with growth.new_biomass = "stress_free", which would yield at every update'
    yield scene.growth.new_biomass == "stress_free", "growth.fluid_forces", wanted


def _numerics_rules(scene: "Scene") -> Rules:
    numerics = scene.numerics
    for key, only in HIGHER_ORDER.items() if numerics.order > 1 else ():
        wanted = f'"{only}" is needed with numerics.elements = "{numerics.elements}"; "linear" has the others'
        yield getattr(numerics, key) != only, f"numerics.{key}", wanted
    gear = numerics.time == "midpoint" and numerics.transport == "gear"
    yield gear, "numerics.transport", '"quasi_steady" is needed with numerics.time = "midpoint"'


def _output_rules(scene: "Scene") -> Rules:
    end = scene.growth.end if scene.growth else 0.0
    wanted = f"growth.end is {end:g} h" if scene.growth else "there is no [growth]"
    yield max(scene.output.times or (0.0,)) > end, "output.times", f"none after {end:g} h is accepted: {wanted}"
    missing = scene.output.timeseries == "netcdf" and find_spec("xarray") is None
    yield missing, "output.timeseries", '"csv" is needed, or the package xarray: pip install xarray'


def _steady(scene: "Scene") -> bool:
    return scene.numerics.transport == "quasi_steady"
