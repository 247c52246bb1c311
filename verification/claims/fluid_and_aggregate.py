"""C26, C35: the fluid's forces on the aggregate, and the flow through it.

C40, C46: the links of stress, flow, growth and detachment that section 5 proposes.

The stress has no largest value. The aggregate slides on the walls, and one fixed point of each contact surface (2.3.3)
bears the pull of the fluid and of the other wall. In two dimensions the stress around a point force goes as one over
the distance. A tear is larger than a point. The stress at a place is therefore the mean over the part of the aggregate
within a tenth of the pore's width. The note reports it for half and twice this distance.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
import shapely
from scipy.spatial import KDTree

from repro.fem.mesh import gradients
from repro.march import simulation
from repro.march.ends import Detachment
from repro.model import contact, growth
from repro.model.flow import MPA_PER_UM
from repro.model.mechanics import Mechanics
from repro.model.solid import Shape
from verification.claims import FEW, FEW_WORDS, Finding, at_least, at_most, claim
from verification.claims.levels import ABOUT_WIDE, CONVERGED, FORCES, PAIRED, Level, at_level
from verification.claims.rheology import conductivity_change, outline_shift
from verification.claims.runs import (
    BASE,
    END,
    PLOTTED,
    UPDATE,
    WIDE,
    Body,
    Run,
    bodies,
    body,
    body_of,
    history,
    in_plane,
    load_packaged,
    polygon,
    rows_at,
    stress,
    until,
)
from verification.problems import meshes

PASCAL = 1e6  # in a MPa
#: "Small against" means at most a tenth.
SMALL = 0.1


def touching() -> tuple[Body, Body]:
    """Wide's last state that leaves a film to the opposite wall, and its first in contact."""
    run = history(*WIDE)
    return tuple(body_of(run.scene, report) for report in run.contact)


@dataclass(frozen=True)
class Forces:
    """Stresses in one geometry, in Pa.

    head: range of the fluid's pressure over the interface; shear: largest viscous stress along it; growth: largest
    in-plane shear stress in the aggregate; stiffness: least modulus mu_L J^(-2/3) against a further deformation.
    """

    head: float
    shear: float
    growth: float
    stiffness: float

    @property
    def against_growth(self) -> float:
        """Stress of the fluid over stress of growth."""
        return (self.head + self.shear) / self.growth

    @property
    def strain(self) -> float:
        """Estimate of the strain that the fluid would cause."""
        return (self.head + self.shear) / self.stiffness


#: Hours of wide around contact and after it.
HOURS = (34, 35, 40, 42)
#: Wide with rows at HOURS, without and with the fluid's forces.
UNFORCED = ("wide", *until(*HOURS))
FORCED = (*UNFORCED, 'growth.fluid_forces="included"')


@claim("C26", "2.3.3", "fluid forces are small against the forces of growth", fine=FORCES, beside=())
def fluid_forces() -> Finding:
    """Range of rho g phi plus the largest viscous shear on the interface, against growth's shear stress and stiffness;
    and the effect of the forces on conductivity and shape in runs of wide that include them from the seed on.

    The forces are those of the flow fields. A uniform pressure does not deform an incompressible body, so the range of
    the pressure counts. Uniform growth causes P but no shear in the plane [E11], so the comparison is with growth's
    shear stress in the plane. The stiffness shows whether the shape would change.
    """
    film, end = touching()[0], bodies(WIDE)[-1]
    last, early = forces(end), forces(body(BASE, UPDATE))
    chosen = {"base, 19.2 h": forces(body(BASE, PLOTTED)), "wide, a film left": forces(film), "wide, a plug": last}
    checks = [at_most(f"{name}: {ratio}", "neglected", value, SMALL, "small: a tenth")
              for name, aggregate_forces in chosen.items()
              for ratio, value in (("fluid's over growth's stress", aggregate_forces.against_growth),
                                  ("strain that the fluid would cause", aggregate_forces.strain))]
    effects = {hour: effect_of_forces(hour) for hour in HOURS}
    checks += [at_most(f"forces included, wide, {hour} h: {name} (%)", "neglected", abs(effect[name]), 100 * FEW,
                       FEW_WORDS) for hour, effect in effects.items() for name in list(effect)[:-1]]
    most = max(abs(effect["conductivity"]) for effect in effects.values())
    reason = (f"it holds in base, and in wide while a film of fluid is left. Later a head of {last.head:.3g} Pa drives "
              f"the constant mean velocity through the plug; growth's shear stress is {last.growth:.3g} Pa, and the "
              f"stiffness has fallen as theta^(-2/3) to {last.stiffness:.3g} Pa. The forces are not small as "
              f"stresses, but they change the conductivity by {most:.1g} % at most")
    changes = "; ".join(f"{hour} h: {effect['conductivity']:+.2f} %, {effect['shift']:+.1f} um"
                        for hour, effect in effects.items())
    note = (f"In base at {UPDATE} h, when growth has hardly begun, the first ratio is {early.against_growth:.2g}, but "
            f"the strain {early.strain:.1g}. Wide with the fluid's forces, change of the conductivity, and shift "
            f"downstream by which both outlines overlap most: {changes}.")
    return Finding(tuple(checks), reason=reason, note=note)


def effect_of_forces(hour: float) -> dict[str, float]:
    """Changes (%) of wide at an hour by the fluid's forces: conductivity, area and outlines, moved onto each other and
    where they lie; and the shift downstream (um) by which the outlines overlap most."""
    shift, in_place, moved = outline_shift(FORCED, hour, UNFORCED)
    areas = [body(run, hour).outline.area for run in (UNFORCED, FORCED)]
    return {"conductivity": conductivity_change(FORCED, (hour,), UNFORCED), "area": 100 * (areas[1] / areas[0] - 1),
            "outlines moved onto each other": moved, "outlines where they lie": in_place, "shift": shift}


def forces(aggregate: Body) -> Forces:
    """The forces of an aggregate."""
    head, shear = interface_forces(aggregate)
    drive, modulus = aggregate.scene.flow, PASCAL * aggregate.scene.growth.shear_modulus
    weight = PASCAL * MPA_PER_UM * drive.density * drive.gravity
    return Forces(weight * float(np.ptp(head)), weight * float(np.abs(shear).max()),
                  modulus * float(in_plane(stress(aggregate)).max()),
                  modulus * float((aggregate.mean(aggregate.strained.J) ** (-2 / 3)).min()))


def interface_forces(aggregate: Body) -> tuple[np.ndarray, np.ndarray]:
    """(e,) head phi and viscous shear nu / g n.(grad u + grad u^T).s on each interface edge, um of water."""
    drive, flow = aggregate.scene.flow, aggregate.solved.flow
    first, last, beyond = interface(aggregate)
    slope = np.einsum("tai,tak->tik", flow.velocity[beyond], gradients(aggregate.grid.points, beyond))
    edge = aggregate.grid.points[last] - aggregate.grid.points[first]
    s = edge / np.linalg.norm(edge, axis=1)[:, None]
    n = np.column_stack([s[:, 1], -s[:, 0]])
    shear = np.einsum("ei,eik,ek->e", n, slope + np.swapaxes(slope, 1, 2), s)
    return 0.5 * (flow.head[first] + flow.head[last]), drive.kinematic_viscosity / drive.gravity * shear


def interface(aggregate: Body) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """First and last corner (e,) of each interface edge, counterclockwise, and the corners (e, 3) of the fluid triangle
    beyond it."""
    loop, chosen = aggregate.grid.straight.loop, aggregate.outline.corners.interface_edges()
    first, last = loop[chosen], np.roll(loop, -1)[chosen]
    fluid = aggregate.grid.triangles[~aggregate.grid.biomass]
    sides = sp.csr_array((np.arange(fluid.size), (fluid.ravel(), np.roll(fluid, -1, axis=1).ravel())))
    return first, last, fluid[sides[last, first] // 3]


@claim("C35", "Fig 5", "the fluid flows around the aggregate, through it once it spans the pore", **ABOUT_WIDE)
def crossing() -> Finding:
    """Share of the flux that crosses x = 0 inside the aggregate: base at 19.2 h, wide at its contact and its end."""
    film, touched = touching()
    last = bodies(WIDE)[-1]
    through = "all of it; 5 % for the flux of u through a plug of stabilised linear triangles"
    checks = (at_most("base, 19.2 h: share through the aggregate (%)", "around", inside(body(BASE, PLOTTED)), 5,
                      "all but a few percent"),
              *(at_least(f"wide, {aggregate.pore.time:.2f} h: share through the aggregate (%)", "through",
                         inside(aggregate), 95, through) for aggregate in (touched, last)))
    half = next(aggregate for aggregate in bodies(WIDE)
                if aggregate.pore.time > touched.pore.time - 5 and inside(aggregate) > 50)
    film_left = half.grid.width - half.outline.thickness
    return Finding(checks, note="The flux crosses the aggregate before contact, because lambda is finite: in wide, in "
                   f"whole hours, more than half of it from {half.pore.time:g} h on, with a film of "
                   f"{max(film_left, 0.0):.1f} um, and {inside(film):.2g} % in the last shape with a film.",
                   reason="at contact some of the flux still passes beside the aggregate")


def inside(aggregate: Body) -> float:
    """Flux of u_x over the part of x = 0 that is in the aggregate, in percent of u_ave W."""
    parts, flow = 1000, aggregate.solved.flow
    line = shapely.LineString([(0.0, -1.0), (0.0, aggregate.grid.width + 1.0)])
    height = shapely.intersection(polygon(aggregate.outline), line).length
    y = (np.arange(parts) + 0.5) / parts * height
    speed = meshes.field_at(aggregate.pore.space, flow.velocity, np.column_stack([0 * y, y]))[:, 0]
    return 100 * float(speed.mean() * height) / (flow.mean_velocity * aggregate.grid.width)


#: The distance over which the stress is averaged, over the pore's width; and all reported distances.
AVERAGED_OVER = 0.1
DISTANCES = (0.5 * AVERAGED_OVER, AVERAGED_OVER, 2 * AVERAGED_OVER)
#: Means are taken at points a distance over PLACES apart; DEGREE of the quadrature of the stress.
PLACES, DEGREE = 4, 8
#: The states of C46: run and hour.
STATES = ((BASE, END), (WIDE, 30.0), (WIDE, 40.0))


@dataclass(frozen=True)
class Peak:
    """A largest stress. value: over mu_L; x, y: its position (um)."""

    value: float
    x: float
    y: float

    @property
    def description(self) -> str:
        """Value and position as text."""
        return f"{self.value:.3g} mu_L at ({self.x:.0f}, {self.y:.0f}) um"


def averaged(aggregate: Body, distance: float, places: np.ndarray) -> np.ndarray:
    """(p, 4) Cauchy stress over mu_L, means over the part of the aggregate within a distance (um) of places (p, 2)."""
    solid = aggregate.pore.body.solid
    shape = Shape(solid.shape.cells, solid.shape.corners, DEGREE)
    finer = replace(aggregate, pore=aggregate.pore.with_body(solid=replace(solid, shape=shape)))
    where, areas = meshes.quadrature_points(aggregate.grid.points[aggregate.triangles], shape.table)
    within = KDTree(places).sparse_distance_matrix(KDTree(where.reshape(-1, 2)), distance, output_type="coo_matrix")
    weights = sp.csr_array((areas.ravel()[within.col], (within.row, within.col)), shape=within.shape)
    means = (weights @ finer.stress.reshape(-1, 4)) / weights.sum(axis=1)[:, None]
    return means / aggregate.scene.growth.shear_modulus


def peak(aggregate: Body, part: float = AVERAGED_OVER) -> Peak:
    """Largest principal value of the stress in the mean over a part of the pore's width, and where."""
    distance = part * aggregate.grid.width
    places = lattice(aggregate, distance / PLACES)
    values = growth.largest_principal(averaged(aggregate, distance, places))
    worst = int(values.argmax())
    return Peak(float(values[worst]), *map(float, places[worst]))


def lattice(aggregate: Body, spacing: float) -> np.ndarray:
    """(p, 2) um: the points of a square lattice through the origin that are in the aggregate, whatever its mesh is."""
    outline = aggregate.outline
    x = spacing * np.arange(np.ceil(outline.upstream / spacing), np.floor(outline.downstream / spacing) + 1)
    y = spacing * np.arange(np.floor(aggregate.grid.width / spacing + 1e-9) + 1)
    places = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    return places[shapely.intersects_xy(polygon(outline), *places.T)]


#: A tensile strength (Pa) between the largest stresses of wide at 30 and at 40 h. The paper gives none.
STRENGTH = 50.0


@claim("C40", "5", "detachment by fracture along the lines of maximum stress can be incorporated",
       date="2026-11-29 23:14", fine=PAIRED, beside=())
def tearing() -> Finding:
    """The hour at which wide tears with a tensile strength. "Can": one scene is enough. The run ends there: no model of
    ours says what becomes of the pieces. The note has the largest principal stress in the aggregate of base and wide,
    and its position, where it would tear first."""
    torn, message = torn_at(STRENGTH)
    check = at_most(f"hour at which wide tears with a strength of {STRENGTH:g} Pa", "can be incorporated", torn,
                    bodies(WIDE)[-1].pore.time - 0.1, "before it ends")
    return Finding((check,), change="the strength is ours, and a tear ends the run", reason="wide does not tear",
                   note=lambda: f"{message}. {_most_stressed()}")


def torn_at(strength: float) -> tuple[float, str]:
    """The hour at which wide tears with a tensile strength (Pa), and the message; its end and "" if it does not."""
    scene = load_packaged("wide", f'growth.tensile_strength="{strength / PASCAL!r} MPa"')
    message = ""
    try:
        for state, _ in simulation.steps(scene):
            time = state.pore.time
    except Detachment as tear:
        message = str(tear)
    return time, message


def _most_stressed() -> str:
    """Describe the largest principal stresses of base and wide."""
    most_stressed = {run: max(bodies(run)[1:], key=tension) for run in (BASE, WIDE)}
    places = " and ".join(f"{peak(aggregate).description} and {aggregate.pore.time:g} h in {run[0]}"
                          for run, aggregate in most_stressed.items())
    return (f"The largest principal stress, in the mean over W / 10, is {places}. "
            f"{_on_another_size(most_stressed)}")


#: Size of the elements of the figure.
FIGURE = PAIRED[1]


def _on_another_size(most_stressed: dict[Run, Body]) -> str:
    """Describe the location of the largest stress, at this level and on the element size of the figure."""
    preset_x = [peak(aggregate).x for aggregate in most_stressed.values()]
    hours = [aggregate.pore.time for aggregate in most_stressed.values()]
    with at_level(Level(CONVERGED, FIGURE)):
        paired_x = [peak(body((*run, rows_at(hour)), hour)).x for run, hour in zip(most_stressed, hours)]
    places = ", ".join(f"at x = {x:.0f} and {paired:.0f} um in {run[0]}"
                       for run, x, paired in zip(most_stressed, preset_x, paired_x))
    return ("The position is less certain than the value: here and with the elements of its figure, "
            f"{FIGURE:g} times those of the preset, it is {places}.")


@claim("C46", "5", "the stress could link fluid flow, growth and detachment: the fluid changes the stress of which the "
       "aggregate would tear", date="2026-11-29 17:23", **ABOUT_WIDE)
def stress_changed_by_fluid() -> Finding:
    """Largest principal stress, in the mean over a tenth of the pore's width, with the fluid's forces and without: of
    base at 19.4 h and of wide at 30 h, with a film left, and of wide at 40 h, a plug under constant velocity. The
    statement holds if the fluid changes the stress in one of these states."""
    pairs = {f"{run[0]}, {hour:g} h": (body(run, hour), with_fluid_forces(body(run, hour))) for run, hour in STATES}
    largest_effect = max(abs(fluid_effect(pair)) for pair in pairs.values())
    check = at_least("largest principal stress, in the mean over W / 10, changed by the fluid, the most of three "
                     "states (%)", "could provide a link", largest_effect, 100 * FEW, f"more than {FEW_WORDS}")
    return Finding((check,), reason="the fluid changes the stress by a few percent at most",
                   note=lambda: _describe_fluid_effect(pairs))


def fluid_effect(pair: tuple[Body, Body], part: float = AVERAGED_OVER) -> float:
    """Change (%) of the largest principal stress by the fluid."""
    unforced, forced = (peak(aggregate, part).value for aggregate in pair)
    return 100 * (forced / unforced - 1)


def _describe_fluid_effect(pairs: dict[str, tuple[Body, Body]]) -> str:
    peaks = "; ".join(f"{name} {peak(unforced).description} and {peak(forced).description}"
                      for name, (unforced, forced) in pairs.items())
    changes = "; ".join(f"{name} {_changes(pair)}" for name, pair in pairs.items())
    return (f"Without and with the fluid's forces: {peaks}. Changes (%) in the mean over W / 20, W / 10 and W / 5: "
            f"{changes}. The stress at a point has no largest value.")


def _changes(pair: tuple[Body, Body]) -> str:
    """Change (%) of the stress by the fluid, in means over each of DISTANCES."""
    return ", ".join(f"{fluid_effect(pair, part):.2g}" for part in DISTANCES)


def with_fluid_forces(aggregate: Body, fluid_forces: str = "included") -> Body:
    """The same aggregate at rest with the fluid's forces "included" or "neglected". The result does not depend on the
    path, because the aggregate is elastic. It leaves out the effect of the forces on growth. Raises GrowthError if
    shape and flow do not agree."""
    scene = replace(aggregate.scene, growth=replace(aggregate.scene.growth, fluid_forces=fluid_forces))
    pore = contact.expand(Mechanics.of(scene), aggregate.pore, [aggregate.pore.body.theta]).pore
    return Body(scene, pore, aggregate.solved)


def tension(aggregate: Body) -> tuple[float, float, float, float]:
    """Largest principal stress (MPa) of a triangle, its place (um) and time (h)."""
    values = aggregate.mean(growth.largest_principal(aggregate.stress))
    worst = int(values.argmax())
    x, y = aggregate.grid.points[aggregate.triangles[worst]].mean(axis=0)
    return float(values[worst]), float(x), float(y), round(aggregate.pore.time, 9)
