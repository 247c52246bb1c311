"""Constraints between the keys of a scene."""
import math
from collections.abc import Iterator
from dataclasses import fields
from itertools import combinations
from typing import TYPE_CHECKING

from repro.scene.time_table import TimeTable

if TYPE_CHECKING:
    from repro.scene import (
        Aggregate,
        Donor,
        Erosion,
        Flow,
        Growth,
        Kinetics,
        Pore,
        Scene,
        Substrates,
    )

_NO_STATE = "without a supply no state is steady"
_UNSTEADY = f', or numerics.transport = "gear": {_NO_STATE}'
MOST_STEPS = 100_000  # shape updates of a run
MOST_ROWS = 10_000  # of output.every
SHORTEST_STEP = 1e-6  # h: times closer than 1e-9 h are equal
FINEST = 1e-3  # of the width: the smallest seed, edge of an outline, and gap between two edges
NEAREST = 1e-4  # of the width: from a point of an outline to a wall that it does not touch
TIGHTEST = 1e-11  # of the square of the width: the smallest permeability

#: A number or a table over time.
Driven = float | TimeTable | None
Outlined = tuple[tuple[float, float], ...]
#: Is a rule broken, and the requirement of each key involved, the likeliest first.
Rules = Iterator[tuple[bool, dict[str, str]]]


def rules(scene: "Scene") -> Rules:
    """All rules: is each broken, and the requirement of each key given the others."""
    for key, aggregate in zip(scene.aggregate_keys, scene.aggregates):
        yield from _aggregate_rules(scene, key, aggregate)
    yield from _pair_rules(scene)
    if scene.flow:
        yield from _flow_rules(scene, scene.flow)
    if scene.substrates:
        yield from _substrate_rules(scene, scene.substrates)
    for name in ("kinetics", "growth") if not (scene.substrates and scene.aggregates) else ():
        yield getattr(scene, name) is not None, {
            name: "[aggregate] and [substrates] are needed with it"}
    if scene.kinetics:
        yield from _kinetics_rules(scene.kinetics, scene.substrates.donor)
    if scene.growth:
        yield from _growth_rules(scene, scene.growth)
    yield from _numerics_rules(scene)
    yield from _output_rules(scene)


def _not_both(other: str, value: str = "") -> str:
    """Requirement of a key that excludes ``other``."""
    setting = f"{other} ({value})" if value else other
    return (f"{setting} is set too; only one of them is accepted "
            f"(--unset {other} removes it)")


def _aggregate_rules(scene: "Scene", place: str, aggregate: "Aggregate") -> Rules:
    """Rules of one aggregate; place: its dotted key."""
    key = f"{place}.name"
    taken = {field.name for field in fields(aggregate)}
    yield aggregate.name in taken, {key: "another name is needed: it is a key of [aggregate]"}
    named = [seed.name for seed in scene.aggregates if seed.name]
    yield named.count(aggregate.name) > 1 and place != f"aggregate.{aggregate.name}", {
        key: "another name is needed: each aggregate has its own"}
    symmetry = 'pore.upper_wall = "symmetry": no aggregate sits on a plane of symmetry'
    yield aggregate.wall == "upper" and scene.pore.upper_wall == "symmetry", {
        f"{place}.wall": f'"lower" is needed with {symmetry}',
        "pore.upper_wall": f'"no slip" is needed with {place}.wall = "upper"'}
    radius = "" if aggregate.radius is None else f"{aggregate.radius:g} um"
    if aggregate.outline is None:
        yield from _seed_rules(place, aggregate, scene.pore)
    else:
        yield bool(radius), {f"{place}.radius": _not_both(f"{place}.outline"),
                             f"{place}.outline": _not_both(f"{place}.radius", radius)}
        yield from _shape_rules(f"{place}.outline", aggregate, scene.pore)
    inert = aggregate.inert_fraction != 0 and scene.substrates is None
    requirement = "0 is needed without [substrates]: inert biomass differs in uptake alone"
    yield inert, {f"{place}.inert_fraction": requirement}


def _pair_rules(scene: "Scene") -> Rules:
    """Rules of the distances between aggregates at t = 0."""
    if len(scene.aggregates) < 2:
        return
    from shapely import Point, Polygon

    growth = scene.growth
    least = growth.minimum_film if growth else FINEST * scene.pore.width
    named = "growth.minimum_film" if growth else "a thousandth of pore.width"
    bodies = []
    for place, aggregate in zip(scene.aggregate_keys, scene.aggregates):
        points, reach = _extent(aggregate, scene.pore.width)
        bodies.append((place, Polygon(points) if len(points) > 1 else Point(points), reach))
    for (one, near, reach), (other, far, extent) in combinations(bodies, 2):
        gap = near.distance(far) - reach - extent
        distance = f"are {gap:.3g} um apart" if gap > 0 else "overlap or touch"
        requirement = f"{one} and {other} {distance}; {named} ({least:g} um) or more is needed"
        yield gap < least, {f"{place}.{key}": requirement for place in (other, one)
                            for key in ("position", "radius", "outline")}


def _extent(aggregate: "Aggregate", width: float) -> tuple[Outlined, float]:
    """An aggregate as the points within a distance (um) of others: the middle of a half-disc, or
    the corners of an outline."""
    x = aggregate.position
    if aggregate.outline is None:
        level = 0.0 if aggregate.wall == "lower" else width
        return ((x, level),), aggregate.radius
    return tuple((x + each, y) for each, y in aggregate.outline), 0.0


def _seed_rules(place: str, aggregate: "Aggregate", pore: "Pore") -> Rules:
    radius = aggregate.radius
    stated = f"{place}.radius ({radius:g} um)"
    requirement = (f"less than pore.width ({pore.width:g} um) and half of pore.length "
                   f"({pore.length:g} um) is needed")
    yield radius >= pore.width, {f"{place}.radius": requirement,
                                 "pore.width": f"more than {stated} is needed"}
    yield 2 * radius >= pore.length, {f"{place}.radius": requirement,
                                      "pore.length": f"more than twice {stated} is needed"}
    yield radius < pore.width * FINEST, {
        f"{place}.radius": f"a thousandth of pore.width ({pore.width:g} um) or more is needed",
        "pore.width": f"at most a thousand times {stated} is needed"}
    position = f"{place}.position ({aggregate.position:g} um)"
    half = f"half of pore.length ({pore.length:g} um)"
    yield abs(aggregate.position) + radius >= pore.length / 2, {
        f"{place}.position": f"less than {half} less {stated}, upstream or downstream, is needed",
        f"{place}.radius": f"less than {half} less the distance of {position} is needed",
        "pore.length": f"more than twice {stated} and the distance of {position} is needed"}
    yield aggregate.smooth, {f"{place}.smooth": f"true is accepted only with {place}.outline"}


#: An outline's wall in messages: y on it, the opposite wall, y on that, and accepted values of y.
SIDES = {"lower": ("y = 0 um", "upper wall", "y = pore.width", "0 < y <= pore.width ({})"),
         "upper": ("y = pore.width", "lower wall", "y = 0", "0 <= y < pore.width ({})")}


def _shape_rules(key: str, aggregate: "Aggregate", pore: "Pore") -> Rules:
    """Rules of an outline. ``points`` have their y from its own wall."""
    own, wall, opposite, accepted = SIDES[aggregate.wall]
    width, half = pore.width, pore.length / 2
    drawn, _ = _extent(aggregate, width)
    points = tuple((x, y if aggregate.wall == "lower" else width - y) for x, y in drawn)
    first, *_, last = points
    yield first[1] != 0 or last[1] != 0, {key: f"{own} at the first and the last point is needed"}
    requirement = "the upstream end first (x of the first point less than of the last) is needed"
    yield first[0] >= last[0], {key: requirement}
    for number, ((x, y), stated) in enumerate(zip(points, drawn), 1):
        name = f"point {number} ({stated[0]:g} um, {stated[1]:g} um)"
        yield abs(x) >= half, {
            key: f"|x| < half of pore.length ({pore.length:g} um) at {name} is needed",
            "pore.length": f"more than twice |x| of {name} of {key} is needed"}
        requirement = f"{accepted.format(f'{width:g} um')} at {name} is needed"
        yield y <= 0 and 1 < number < len(points), {key: requirement}
        yield y > width, {key: requirement,
                          "pore.width": f"y of {name} of {key}, or more, is needed"}
        yield 0 < min(y, width - y) < width * NEAREST, {
            key: f"pore.width ({width!r} um) over 10000, or more, is needed between {name} and a "
                 f"wall that it does not touch; {opposite} is contact"}
        yield half - abs(x) < width * NEAREST, {
            key: f"pore.width over 10000, or more, is needed between {name} and the pore's end"}
    least = f"a thousandth of pore.width ({width:g} um) or more is needed"
    for number, (start, end) in enumerate(zip(points, points[1:]), 1):
        yield math.dist(start, end) < width * FINEST, {
            key: f"{least} from point {number} to the next"}
    yield last[0] - first[0] < width * FINEST, {
        key: f"{least} between the first and the last point"}
    above = [number for number, (_, y) in enumerate(points) if y == width]
    interrupted = bool(above) and above[-1] - above[0] != len(above) - 1
    yield len(above) == 1 or interrupted, {
        key: f"two points or more in a row, or none, on the {wall} ({opposite}) are needed"}
    from shapely import LineString

    line = LineString([(x / width, y / width) for x, y in points])
    yield not line.is_simple, {
        key: "a line that neither crosses nor touches itself is needed"}
    for one, other in nearest_edges(points, width):
        yield True, {key: f"{least} between the lines after points {one} and {other}"}


def nearest_edges(points: Outlined, width: float) -> list[tuple[int, int]]:
    """The first pair of edges without a common point that are closer than ``FINEST`` widths.

    points: from the lower wall to the lower wall, (x, y) in um; width: of the pore, um. Returns
    the numbers of the first points of both edges, or an empty list.
    """
    import shapely

    edges = shapely.linestrings([*zip(points, points[1:])])
    tree = shapely.STRtree(edges)
    least = (1 - 1e-9) * width * FINEST
    first, second = tree.query(edges, predicate="dwithin", distance=least)
    near = first + 1 < second
    return sorted(zip((first[near] + 1).tolist(), (second[near] + 1).tolist()))[:1]


def _flow_rules(scene: "Scene", drive: "Flow") -> Rules:
    example = 'such as head = "1e-3 cm" or mean_velocity = "2.9 m/day"'
    drives = {"flow.head": _in_words(drive.head, "um"),
              "flow.mean_velocity": _in_words(drive.mean_velocity, "m/day", 24e-6),
              "flow.rate": _in_words(drive.rate, "uL/min", 1e-9 / 60)}
    yield not any(drives.values()), {
        "flow.head": f"it, flow.mean_velocity or flow.rate is needed, {example}"}
    for one, other in combinations(drives, 2):
        yield bool(drives[one] and drives[other]), {
            other: _not_both(one, drives[one]), one: _not_both(other, drives[other])}
    yield drive.rate is not None and scene.pore.depth is None, {
        "flow.rate": "pore.depth is needed with it",
        "pore.depth": "it is needed with flow.rate"}
    still = "flow.mean_velocity" if drive.rate is None else "flow.rate"
    yield scene.stagnant and scene.numerics.transport == "quasi_steady", {
        still: f"greater than zero is needed{_UNSTEADY}",
        "numerics.transport": f'"gear" is needed with {still} = 0: {_NO_STATE}'}
    if drive.permeability is None:
        return
    permeable = f"flow.permeability = {drive.permeability} um^2"
    yield drive.viscosity_ratio is not None, {
        "flow.permeability": _not_both("flow.viscosity_ratio", f"{drive.viscosity_ratio}"),
        "flow.viscosity_ratio": _not_both("flow.permeability", f"{drive.permeability} um^2")}
    least = TIGHTEST * scene.pore.width**2
    yield drive.permeability < 0.999 * least, {
        "flow.permeability": f'"{1e-12 * least:.4g} m^2" or more is needed in a pore '
                             f"{scene.pore.width:g} um wide: below it round-off hides the flow",
        "pore.width": f"{math.sqrt(drive.permeability / TIGHTEST):.4g} um or less is needed with "
                      f"{permeable}"}
    yield not scene.aggregates, {
        "flow.permeability": "[aggregate] is needed with it: it is that of the biomass"}
    requirement = '"fast", "accurate", "exact" or "sketch" is needed with'
    yield scene.numerics.scheme.order == 1, {
        "flow.permeability": f"numerics.preset = {requirement} it: it needs quadratic elements",
        "numerics.preset": f"{requirement} {permeable}, which needs quadratic elements"}


def _in_words(value: Driven, unit: str, factor: float = 1.0) -> str:
    if value is None:
        return ""
    return "a table" if isinstance(value, TimeTable) else f"{factor * value:g} {unit}"


def _substrate_rules(scene: "Scene", substrates: "Substrates") -> Rules:
    for name, part in substrates.modelled.items():
        key = f"substrates.{name}.diffusivity_in_aggregate"
        yield part.diffusivity_in_aggregate <= 0, {key: "greater than zero is needed"}
    closed = substrates.boundary == "closed"
    yield closed and scene.flow is not None, {
        "substrates.boundary": '"open" is needed with [flow]',
        "flow": 'substrates.boundary = "open" is needed with it'}
    yield closed and scene.numerics.transport == "quasi_steady", {
        "substrates.boundary": f'"open" is needed{_UNSTEADY}',
        "numerics.transport": f'"gear" is needed with substrates.boundary = "closed": {_NO_STATE}'}


def _kinetics_rules(law: "Kinetics", donor: "Donor | None") -> Rules:
    implied = law.implied_ratio
    demand = f"kinetics.donor_oxygen_demand ({law.donor_oxygen_demand})"
    biomass = law.yield_coefficient * law.decay_oxygen_demand
    less = f"a smaller value is needed: Y d_c ({biomass:g}) is not less than {demand}"
    yield implied is not None and implied <= 0, {
        "kinetics.donor_oxygen_demand": f"more than Y d_c ({biomass:g}) is needed: F = COD - Y d_c "
                                        "is positive",
        "kinetics.yield_coefficient": less,
        "kinetics.decay_oxygen_demand": less}
    haldane = law.law == "Haldane"
    yield haldane and donor is None, {
        "kinetics.law": '[substrates.donor] is needed with "Haldane": the donor inhibits',
        "substrates.acceptor": '[substrates.donor] is needed with kinetics.law = "Haldane"'}
    changed = donor is not None and donor.inhibition_constant != type(donor)().inhibition_constant
    yield changed and not haldane, _only_with(
        "substrates.donor.inhibition_constant", "kinetics.law", "Haldane")


def _only_with(key: str, other: str, word: str) -> dict[str, str]:
    """Requirements of a key that is accepted with one word of another key."""
    return {key: f'{other} = "{word}" is needed with it',
            other: f'"{word}" is needed with {key}'}


def _growth_rules(scene: "Scene", growth: "Growth") -> Rules:
    end, step = growth.end, growth.time_step
    yield step < SHORTEST_STEP, {"growth.time_step": f"{SHORTEST_STEP:g} h or more is needed"}
    yield end > MOST_STEPS * step, {
        "growth.time_step": f"growth.end ({end:g} h) over {MOST_STEPS} or more is needed",
        "growth.end": f"at most {MOST_STEPS} times growth.time_step ({step:g} h) is needed"}
    stress_free = growth.new_biomass == "stress_free"
    for key in ("bonding_strength", "tensile_strength"):
        strength = getattr(growth, key)
        yield strength is not None and stress_free, {
            f"growth.{key}": 'growth.new_biomass = "stressed" is needed with it, since the stress '
                             "counts from t = 0",
            "growth.new_biomass": f'"stressed" is needed with growth.{key} = {strength} MPa'}
    yield growth.continues and growth.bonding_strength is None and growth.erosion is None, {
        "growth.after_detachment": "growth.bonding_strength or [growth.erosion] is needed with "
                                   "\"continue\"",
        "growth.bonding_strength": 'needed with growth.after_detachment = "continue"'}
    changed = growth.limiting_invariant != type(growth).limiting_invariant
    yield changed and growth.energy != "Gent", _only_with(
        "growth.limiting_invariant", "growth.energy", "Gent")
    if growth.erosion:
        yield from _erosion_rules(scene, growth, growth.erosion)
    yield from _mirrored_rules(growth, scene.pore.upper_wall)
    included = growth.has_fluid_forces
    yield included and scene.flow is None, {
        "growth.fluid_forces": '"neglected" is needed without [flow]'}
    yield included and stress_free, {
        "growth.fluid_forces": '"neglected" is needed with growth.new_biomass = "stress_free", '
                               "because the aggregate would yield at every update",
        "growth.new_biomass": '"stressed" is needed with growth.fluid_forces = "included"'}
    film = growth.minimum_film
    yield film >= scene.pore.width, {
        "growth.minimum_film": f"less than pore.width ({scene.pore.width:g} um) is needed",
        "pore.width": f"more than growth.minimum_film ({film:g} um) is needed"}


#: The key that each law of erosion needs.
LAWS = {"constant": "speed", "thickness squared": "thickness_coefficient",
        "shear": "shear_coefficient"}


def _erosion_rules(scene: "Scene", growth: "Growth", erosion: "Erosion") -> Rules:
    for law, key in LAWS.items():
        place = f"growth.erosion.{key}"
        value = getattr(erosion, key)
        yield law == erosion.law and value is None, {
            place: f'needed with growth.erosion.law = "{law}"'}
        yield law != erosion.law and value is not None, _only_with(
            place, "growth.erosion.law", law)
    yield erosion.law != "shear" and erosion.critical_shear > 0, _only_with(
        "growth.erosion.critical_shear", "growth.erosion.law", "shear")
    yield erosion.law == "shear" and scene.flow is None, {
        "growth.erosion.law": '[flow] is needed with "shear"'}
    yield growth.new_biomass == "stressed", {
        "growth.erosion": 'growth.new_biomass = "stress_free" is needed with it: what erodes is '
                          "replaced, so that strain since t = 0 grows without limit",
        "growth.new_biomass": '"stress_free" is needed with [growth.erosion]'}
    scheme = scene.numerics.scheme
    yield not (scheme.controls_error and scheme.follows_layers), {
        "growth.erosion": "the curved elements and the midpoint rule are needed with it, such as "
                          'those of numerics.preset = "fast"',
        "numerics.preset": '"fast", "accurate" or "exact" is needed with [growth.erosion]'}


def _mirrored_rules(growth: "Growth", upper_wall: str) -> Rules:
    """Beside a plane of symmetry, forces of walls and water are not verified, so not accepted."""
    unverified = {"fluid_forces": growth.has_fluid_forces, "wall": growth.bonded,
                  "bonding_strength": growth.bonding_strength is not None,
                  "tensile_strength": growth.tensile_strength is not None}
    for key, is_set in unverified.items():
        yield upper_wall == "symmetry" and is_set, {
            f"growth.{key}": 'pore.upper_wall = "no slip" is needed with it',
            "pore.upper_wall": f'"no slip" is needed with growth.{key}: forces on an aggregate '
                               "beside a plane of symmetry are not verified"}


def _numerics_rules(scene: "Scene") -> Rules:
    yield scene.stagnant and scene.numerics.extent == "central", {
        "numerics.extent": '"full" is needed with substrates in water at rest',
        "flow.mean_velocity": 'numerics.extent = "full" is needed with 0 m/day',
    }
    yield scene.numerics.scheme.controls_error and scene.numerics.transport == "gear", {
        "numerics.transport": '"quasi_steady" is needed with the midpoint rule of numerics.preset '
                              f'= "{scene.numerics.preset}"',
        "numerics.preset": '"paper" or "as_printed" is needed with numerics.transport = "gear"',
    }


def _output_rules(scene: "Scene") -> Rules:
    end = scene.growth.end if scene.growth else 0.0
    last = max(scene.output.times or (0.0,))
    reason = f"growth.end is {end:g} h" if scene.growth else "there is no [growth]"
    requirements = {"output.times": f"times up to {end:g} h are accepted: {reason}"}
    if scene.growth:
        requirements["growth.end"] = f"{last:g} h or more, the last of output.times, is needed"
    yield last > end, requirements
    shortest = max(end / MOST_ROWS, SHORTEST_STEP)
    requirement = f"{shortest:.3g} h or more is needed: at most {MOST_ROWS} rows are accepted"
    yield (scene.output.every or math.inf) < shortest, {"output.every": requirement}
