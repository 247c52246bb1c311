"""What keys of a scene ask of each other."""
import math
from collections.abc import Iterator
from importlib.util import find_spec
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from repro.scene import Aggregate, Pore, Scene

_UNSTEADY = ', or numerics.transport = "gear": nothing is supplied, so that no state is steady'
MOST_STEPS = 100_000  # shape updates of a run
FINEST = 1e-3  # of the width: the smallest seed, and edge of an outline
SHORTEST_STEP = 1e-6  # h: times are told apart to 1e-9 h
#: What curved elements have one way of, and what that is.
CURVED = {"time": "midpoint", "transport": "quasi_steady", "transfer": "conserving", "interface": "laplacian",
          "inlet": "local", "fixed_point": "kept", "flow_element": "stabilised"}

Outlined = tuple[tuple[float, float], ...]
Rules = Iterator[tuple[bool, str, str]]  # (is it broken, the key to name, what is accepted)


def rules(scene: "Scene") -> Rules:
    """What is accepted of each key in the light of the others."""
    if scene.aggregate:
        shape_rules = _seed_rules if scene.aggregate.outline is None else _outline_rules
        yield from shape_rules(scene.aggregate, scene.pore)
        without = "0 is needed without [substrates], which tell active from inert biomass"
        inert = scene.aggregate.inert_fraction != 0 and scene.substrates is None
        yield inert, "aggregate.inert_fraction", without
    if scene.flow:
        yield from _flow_rules(scene, scene.flow.head, scene.flow.mean_velocity)
    if scene.substrates:
        yield from _boundary_rules(scene)
    yield from _growth_rules(scene)
    yield from _numerics_rules(scene)
    yield from _output_rules(scene)


def _seed_rules(aggregate: "Aggregate", pore: "Pore") -> Rules:
    radius = aggregate.radius
    length = f"half of pore.length ({pore.length:g} um)"
    wanted = f"less than pore.width ({pore.width:g} um) and {length} is needed"
    yield radius >= pore.width or 2 * radius >= pore.length, "aggregate.radius", wanted
    wanted = f"a thousandth of pore.width ({pore.width:g} um) or more is needed"
    yield radius < pore.width * FINEST, "aggregate.radius", wanted
    wanted = f"less than {length} less aggregate.radius ({radius:g} um), upstream or downstream, is needed"
    yield abs(aggregate.position) + radius >= pore.length / 2, "aggregate.position", wanted
    wanted = "true is accepted with aggregate.outline alone"
    yield aggregate.smooth, "aggregate.smooth", wanted


def _outline_rules(aggregate: "Aggregate", pore: "Pore") -> Rules:
    wanted = "aggregate.outline is given too; one of them is accepted, not both"
    yield aggregate.radius is not None, "aggregate.radius", wanted
    wanted = "0 um is needed with aggregate.outline, whose points say where it is"
    yield aggregate.position != 0, "aggregate.position", wanted
    for broken, wanted in _shape_rules(aggregate.outline, pore):
        yield broken, "aggregate.outline", f"{wanted} is needed"


def _shape_rules(points: Outlined, pore: "Pore") -> Iterator[tuple[bool, str]]:
    """What is wrong with an outline, and what is accepted instead."""
    first = points[0]
    last = points[-1]
    yield first[1] != 0 or last[1] != 0, "y = 0 um at the first and the last point"
    yield first[0] >= last[0], "the upstream end first (x of the first point less than of the last)"
    yield from _inside_rules(points, pore)
    yield from _spacing_rules(points, pore.width)
    yield from _contact_rules(points, pore.width)
    yield _crosses(points, pore.width), "a line that neither crosses nor touches itself"


def _inside_rules(points: Outlined, pore: "Pore") -> Iterator[tuple[bool, str]]:
    for number, (x, y) in enumerate(points, 1):
        point = f"point {number} ({x:g} um, {y:g} um)"
        wanted = f"|x| < half of pore.length ({pore.length:g} um) at {point}"
        yield abs(x) >= pore.length / 2, wanted
        wanted = f"0 < y <= pore.width ({pore.width:g} um) at {point}"
        yield 1 < number < len(points) and not 0 < y <= pore.width, wanted


def _spacing_rules(points: Outlined, width: float) -> Iterator[tuple[bool, str]]:
    for number, (start, end) in enumerate(zip(points, points[1:]), 1):
        wanted = f"a thousandth of pore.width ({width:g} um) or more from point {number} to the next"
        yield math.dist(start, end) < width * FINEST, wanted


def _contact_rules(points: Outlined, width: float) -> Iterator[tuple[bool, str]]:
    above = [number for number, (_, y) in enumerate(points) if y == width]
    run = above == list(range(above[0], above[0] + len(above))) if above else True
    wanted = "two points or more in a row, or none, on the upper wall (y = pore.width)"
    yield len(above) == 1 or not run, wanted


def _crosses(points: Outlined, width: float) -> bool:
    """Does a line cross or touch itself?"""
    from shapely import LineString

    return not LineString([(x / width, y / width) for x, y in points]).is_simple


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
    elements = f'with numerics.elements = "{scene.numerics.elements}"'
    wanted = f'"neglected" is needed {elements}; preset = "paper" has the other'
    yield scene.numerics.curved, "growth.fluid_forces", wanted
    wanted = '"neglected" is needed with growth.new_biomass = "stress_free", which would yield at every update'
    yield scene.growth.new_biomass == "stress_free", "growth.fluid_forces", wanted


def _numerics_rules(scene: "Scene") -> Rules:
    numerics = scene.numerics
    if numerics.curved:
        elements = f'with numerics.elements = "{numerics.elements}"'
        for key, only in CURVED.items():
            wanted = f'"{only}" is needed {elements}; preset = "paper" has the others'
            yield getattr(numerics, key) != only, f"numerics.{key}", wanted
        stress_free = scene.growth is not None and scene.growth.new_biomass == "stress_free"
        yield stress_free, "growth.new_biomass", f'"stressed" is needed {elements}'
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
