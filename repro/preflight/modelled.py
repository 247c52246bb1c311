"""Describe the model of a scene in words, section by section, with the paper's equations."""

from collections.abc import Iterator

from repro.march.simulation import row_times
from repro.results.quantities import UNITS
from repro.scene import Aggregate, Scene, scene_tables
from repro.scene.time_table import TimeTable


def describe_model(scene: Scene) -> list[tuple[str, str]]:
    """(section, description) in the order of the scene, including absent sections."""
    sections = {"pore": _pore, "aggregate": _aggregate, "flow": _flow, "substrates": _substrates,
                "kinetics": _kinetics, "growth": _growth, "numerics": _numerics, "output": _output}
    return [(name, "; ".join(describe(scene))) for name, describe in sections.items()]


def _pore(scene: Scene) -> Iterator[str]:
    yield f"a channel {scene.pore.width:g} um wide and {scene.pore.length:g} um long"
    if scene.pore.upper_wall != "no slip":
        yield f"its upper wall a plane of {scene.pore.upper_wall}"
    if scene.numerics.whole_pore:
        yield "meshed as a whole"
    elif scene.aggregates:
        yield f"meshed around the aggregate{'s' * (len(scene.aggregates) > 1)} (3.1)"
    else:
        yield "meshed over three widths (3.1)"


def _aggregate(scene: Scene) -> Iterator[str]:
    if not scene.aggregates:
        yield "no aggregate: a clean channel"
    several = len(scene.aggregates) > 1
    for label, seed in zip(scene.labels, scene.aggregates):
        yield f"{label}: {_seed(seed)}" if several else _seed(seed)
        if seed.inert_fraction:
            yield f"{100 * seed.inert_fraction:g} % of it inert at t = 0"


def _seed(seed: Aggregate) -> str:
    """Describe a seed."""
    wall = f"on the {seed.wall} wall"
    if seed.outline is None:
        return (f"a half-disc of biomass of radius {seed.radius:g} um {wall} at "
                f"x = {seed.position:g} um")
    through = "a spline through" if seed.smooth else "straight lines between"
    shift = f", moved by {seed.position:g} um" if seed.position else ""
    return f"biomass inside {through} {len(seed.outline)} points{shift}, {wall}"


def _flow(scene: Scene) -> Iterator[str]:
    flow = scene.flow
    if flow is None:
        yield "no flow: pure diffusion"
        return
    yield "Stokes flow (1)-(6)"
    if flow.rate is not None:
        rate = _over_time(flow.rate, "_uL_per_min")
        yield f"driven by {rate} through a depth of {scene.pore.depth:g} um"
    elif flow.head is None:
        yield f"driven by a mean velocity of {_over_time(flow.mean_velocity, '_m_per_d')}"
    else:
        yield f"driven by a head of {_over_time(flow.head, '_cm')} over the whole pore"
    if scene.aggregates:
        yield (f"{flow.viscosity_ratio:g} times the viscosity of water in the aggregate"
               if flow.permeability is None else "an aggregate with a permeability of "
               f"{1e-12 * flow.permeability:g} m2 (Brinkman's drag)")
        yield {"laplacian": "interface in the form of (1) [E2]",
               "traction": "continuous traction [E2]"}[scene.numerics.interface]


def _substrates(scene: Scene) -> Iterator[str]:
    if scene.substrates is None:
        yield "no substrates: no transport is assembled"
        return
    carried = "advection and diffusion" if scene.flow else "diffusion"
    supplies = {name: f"{name} ({_over_time(kind.supply, '_mg_per_L')})"
                for name, kind in scene.substrates.modelled.items()}
    yield f"{carried} of {' and '.join(supplies.values())}, {_equations(scene)}"
    if len(supplies) == 1:
        yield "one substrate: the other is assumed not to limit"
    if scene.flow:
        yield "(11) at the inlet, (12) at the outlet, (13) on the walls"
    else:
        yield {"open": "the supply prescribed at both ends",
               "closed": "closed ends"}[scene.substrates.boundary]
    scheme = scene.numerics.scheme
    if scene.flow and not scheme.conserves_substrates:
        inlet = {"mean": "u_ave", "local": "u_x(y)"}[scheme.inlet]
        yield f"carried by {scheme.carrier}, with {inlet} in (11): not conserved [E4]"
    yield {"quasi_steady": "steady in each shape",
           "gear": "integrated in time (3.3, Gear)"}[scene.numerics.transport]


def _equations(scene: Scene) -> str:
    return "-".join({"acceptor": "(7)", "donor": "(8)"}[name] for name in scene.substrates.modelled)


def _over_time(value: float | TimeTable, ending: str) -> str:
    """A value in the unit with this ending of names, or the range of its table."""
    unit, factor = UNITS[ending].symbol, UNITS[ending].factor
    if not isinstance(value, TimeTable):
        return f"{factor * value:.4g} {unit}"
    least = factor * min(value.values)
    most = factor * value.largest
    interpolation = "linear in time" if value.linear else "in steps"
    return f"{least:.4g} to {most:.4g} {unit}, {interpolation}, the last from {value.times[-1]:g} h"


def _kinetics(scene: Scene) -> Iterator[str]:
    if scene.kinetics is None:
        yield "no uptake, which needs substrates and an aggregate"
        return
    law = scene.kinetics.law
    alone = len(scene.substrates.modelled) == 1
    name = law.removeprefix("dual ") if alone else law
    yield f"{name} uptake by the aggregate, {_equations(scene)}"
    if law == "Haldane":
        yield ("of several solutions, the one that is reached in time from the profile in the "
               "last shape, or from the supply at t = 0")
    if scene.growth:
        yield "growth and decay of active, gain of inert biomass, (9)-(10)"
        yield {"with acceptor": "decay in proportion to m_A: none without acceptor",
               "unlimited": "decay also without acceptor, where its oxygen demand is not met"
               }[scene.kinetics.decay]


def _growth(scene: Scene) -> Iterator[str]:
    growth = scene.growth
    if growth is None:
        yield "no growth: only the state at t = 0"
        return
    limit = f" with J_m = {growth.limiting_invariant:g}" if growth.energy == "Gent" else ""
    yield (f"to {growth.end:g} h: an incompressible {growth.energy} body{limit} that expands with "
           "its biomass, (14)-(29)")
    yield f"films under {growth.minimum_film:g} um close (2.3.3)"
    yield f"fluid forces {growth.fluid_forces}"
    seats = sorted({seed.wall for seed in scene.aggregates})
    yield f"the {' and the '.join(seats)} wall {growth.wall}"
    for key in ("bonding_strength", "tensile_strength"):
        if getattr(growth, key) is not None:
            yield f"{key.replace('_', ' ')} {scene_tables(scene)['growth'][key]}"
    if growth.continues:
        yield "an aggregate that detaches leaves the pore, and the run goes on"
    if len(scene.aggregates) > 1:
        reason = scene.without_weld
        yield (f"aggregates that meet end the run, because {reason}" if reason else
               "aggregates that meet join if this encloses no water, and the run goes on")
    if growth.erosion:
        yield f"free surfaces erode, by the law {growth.erosion.law}"
    if growth.until_steady:
        yield "it ends early if the aggregates are steady"
    yield {"stressed": "strain since t = 0",
           "stress_free": "new biomass without stress (section 5)"}[growth.new_biomass]


def _numerics(scene: Scene) -> Iterator[str]:
    numerics = scene.numerics
    yield f"preset {numerics.preset}"
    yield {"linear": "linear triangles (3.2-3.4)",
           "quadratic": "quadratic curved triangles"}[numerics.scheme.elements]
    yield f"refinement {numerics.refinement:g}"
    if scene.growth:
        yield (f"a shape update every {60 * scene.growth.time_step:.4g} min"
               if not numerics.scheme.controls_error else
               f"midpoint steps, tolerance {numerics.tolerance:g}")
        yield f"biomass to new meshes by {numerics.scheme.transfer} [E8]"


def _output(scene: Scene) -> Iterator[str]:
    times = scene.requested_times
    if times is not None:
        yield f"rows and fields at {len({0.0, *times})} times, including t = 0"
    elif scene.growth:
        rows = row_times(scene)
        yield "rows and fields of every step" + (f", and every {rows[0]:g} h" if rows else "")
    else:
        yield "one row and fields at t = 0"
