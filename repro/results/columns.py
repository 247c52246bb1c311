"""The columns of ``timeseries.csv`` and ``ledger.csv``: each is defined here, once."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from typing import Any

from repro.fem.walls import BOTTOM, TOP, numbered
from repro.march import balance
from repro.march.balance import Ledger
from repro.march.state import Report, stopping
from repro.model.energies.neo_hookean import BIOT, CREASE
from repro.model.surface import BESIDE, STRETCH, least_stretched, surfaces
from repro.model.transport_in_time import transport_in_time
from repro.results.quantities import Quantity, is_modelled, is_solved
from repro.scene import Scene

SUBSTRATES = ("acceptor", "donor")
#: A quantity of substrates at rest jumps where a table for one of these jumps.
AT_REST = "flow and substrates"


#: Parts that a quantity may need: does a report have them?
NEEDS: dict[str, Callable[[Scene, Report], bool]] = {
    "flow": lambda scene, at: at.solved.flow is not None,
    "acceptor": lambda scene, at: is_solved(at.solved, "acceptor"),
    "donor": lambda scene, at: is_solved(at.solved, "donor"),
    "seed": lambda scene, at: bool(scene.aggregates or at.pore.bodies),
    "aggregate": lambda scene, at: bool(at.pore.bodies),
    "biomass": lambda scene, at: bool(at.pore.bodies) and scene.kinetics is not None,
    "substrates": lambda scene, at: at.solved.concentrations is not None,
    "growth": lambda scene, at: NEEDS["seed"](scene, at) and scene.growth is not None,
    "erosion": lambda scene, at: scene.growth is not None and scene.growth.erosion is not None,
    "adhesion": lambda scene, at: (
        scene.growth is not None and bool(at.pore.bodies) and at.pore.accumulates
        and (scene.growth.bonded or scene.growth.has_fluid_forces
             or scene.growth.bonding_strength is not None
             or scene.growth.tensile_strength is not None))}


def _both(pattern: str, words: str, formula: str, value: Callable, *,
          signed: bool = True, jumps: str = AT_REST) -> list[Quantity]:
    """A quantity for each of acceptor and donor, whose names replace {} in the texts."""
    return [Quantity(pattern.format(name), words.format(name), formula, partial(value, k), name,
                     name, signed=signed, jumps=jumps) for k, name in enumerate(SUBSTRATES)]


def _least(k: int, scene: Scene, at: Report) -> float:
    return float(getattr(at.solved.concentrations, SUBSTRATES[k]).min())


def _overshoot(k: int, scene: Scene, at: Report) -> float:
    """mg/L; over the largest supply if the pore may contain water of earlier supplies."""
    supply = getattr(at.solved.problem.substrates, SUBSTRATES[k]).supply
    if transport_in_time(scene.numerics.transport).stores:
        supply = getattr(scene.largest.substrates, SUBSTRATES[k]).supply
    return max(0.0, float(getattr(at.solved.concentrations, SUBSTRATES[k]).max()) - supply)


def _worst(defects: list[float]) -> float:
    """The defect farthest from zero, with its sign; zero if there are no defects."""
    return max(defects, key=abs, default=0.0)


def _substrate_balance(k: int, scene: Scene, at: Report) -> float:
    """The worst defect of the steps since the last row and, unless substrates are stored, of the
    present instant."""
    stores = transport_in_time(scene.numerics.transport).stores
    problem = at.solved.problem
    supply = getattr(problem.substrates, SUBSTRATES[k]).supply
    room = supply * float(problem.space.at.dx.sum()) if stores else 0.0
    largest = getattr(scene.largest.substrates, SUBSTRATES[k]).supply
    floor = balance.floor(problem, k, largest)
    defects = [balance.substrate(ledger, k, max(room, floor * (ledger.end - ledger.start)))
               for ledger in at.ledgers]
    if not stores:
        flux = at.solved.fluxes[k]
        defects.append(balance.defect(flux.supplied, flux.out, flux.consumed, least_scale=floor))
    return _worst(defects)


def _of_steps(defect: Callable[[Ledger], float], at: Report) -> float:
    """The worst defect of the steps since the last row."""
    return _worst([defect(ledger) for ledger in at.ledgers])


def _peak(name: str, words: str, formula: str, label: str, peak: Callable) -> list[Quantity]:
    """The largest mean of a stress, and its place; peak: takes the arguments of a column's value.
    """
    return [Quantity(f"{name}_MPa", words, formula, lambda *of: peak(*of).value, label, "adhesion",
                     signed=True, jumps="flow and forces"),
            *(Quantity(f"{name}_{axis}_um", f"place of the {words}, {axis}",
                       f"middle of the part whose mean is the {words}",
                       lambda *of, axis=axis: getattr(peak(*of), axis),
                       f"{axis} of {label}", "adhesion", signed=axis == "x") for axis in "xy")]


def _adhesion(part: str, scene: Scene, at: Report) -> Any:
    """Call a function of the stresses of aggregates, which a scene without growth does not load.

    Raises SimulationError if the stresses have no equilibrium.
    """
    from repro.model import adhesion
    with stopping(at.pore.time, scene.growth.bonded):
        return getattr(adhesion, part)(adhesion.Loading.of(scene), at.pore, at.solved)


def _all(value: Callable[[int, Scene, Report], float],
         combine: Callable[[Iterable[float]], float]) -> Callable[[Scene, Report], float]:
    """The value of all aggregates, from those of each by its number from zero."""
    return lambda scene, at: combine(value(k, scene, at) for k in range(len(at.pore.bodies)))


def _of_outline(part: str, k: int, scene: Scene, at: Report) -> float:
    return getattr(at.pore.outlines[k], part)


def _load(part: str, k: int, scene: Scene, at: Report) -> float:
    return getattr(_adhesion("fluid_loads", scene, at)[k], part)


def _uptake(substrate: int, k: int, scene: Scene, at: Report) -> float:
    from repro.model.substrates import uptakes  # a scene without [substrates] does not load it
    return float(uptakes(at.solved.problem, at.pore, at.solved.concentrations)[k, substrate])


def _eroded(k: int, scene: Scene, at: Report) -> float:
    from repro.model.erosion import Erosion  # a scene without erosion does not load it
    return Erosion.of(scene).rate(at.pore, k, at.solved.flow)


def _growth(scene: Scene, at: Report) -> float:
    from repro.model.substrates import net_growth
    return net_growth(at.solved.problem, at.pore, at.solved.concentrations, scene.kinetics)


def _composition(index: int, scene: Scene, at: Report) -> float:
    return at.pore.composition(scene.kinetics.maximum_density)[index]


#: Columns of ``timeseries.csv``: value takes the scene and a Report.
SERIES = (
    Quantity("time_h", "simulated time since the start of the run",
             "t; a row at a jump of a table has the state just after it, in all columns",
             lambda scene, at: at.pore.time, "time"),
    Quantity("mean_velocity_m_per_d", "mean velocity", "u_ave: flow through a cross-section / W",
             lambda scene, at: at.solved.flow.mean_velocity, "mean velocity", "flow", jumps="flow"),
    Quantity("head_loss_cm", "head loss over the whole pore",
             "loss of the meshed part (6) + 12 nu u_ave / (g W^2) times the length outside of it, "
             "with 2 W up to a plane of symmetry",
             lambda scene, at: at.solved.flow.head_loss, "head loss", "flow", jumps="flow"),
    Quantity("conductivity_m_per_d", "hydraulic conductivity of the pore",
             "u_ave L / head loss, of the whole pore",
             lambda scene, at: at.solved.flow.conductivity, "conductivity", "flow"),
    *_both("effluent_{}_mg_per_L", "{} leaving (flux-averaged)",
           "integral of u_x C over the outlet of the meshed part / that of u_x; without flow, "
           "the mean of C over it", lambda k, scene, at: at.solved.fluxes[k].effluent),
    *_both("inlet_{}_mg_per_L", "{} at the inlet of the meshed part",
           "integral of u_x C over the inlet of the meshed part / that of u_x; without flow, "
           "the mean of C over it", lambda k, scene, at: at.solved.fluxes[k].inlet),
    Quantity("aggregate_area_um2", "area of the aggregate",
             "area inside its boundary; of several, the sum",
             _all(partial(_of_outline, "area"), sum), "area", "seed"),
    Quantity("thickness_um", "thickness of the aggregate",
             "largest distance of its boundary from its wall; of several, the largest",
             _all(partial(_of_outline, "thickness"), max), "thickness", "aggregate"),
    Quantity("upstream_um", "upstream end of the aggregate",
             "smallest x of its boundary; of several, the smallest",
             _all(partial(_of_outline, "upstream"), min), "upstream end", "aggregate",
             signed=True),
    Quantity("downstream_um", "downstream end of the aggregate",
             "largest x of its boundary; of several, the largest",
             _all(partial(_of_outline, "downstream"), max), "downstream end", "aggregate",
             signed=True),
    Quantity("meshed_length_um", "length of the meshed part", "x of its outlet - x of its inlet",
             lambda scene, at: at.pore.mesh.ends[1] - at.pore.mesh.ends[0], "length"),
    Quantity("inert_fraction", "inert part of the biomass",
             "integral of X_I / integral of X_A + X_I",
             partial(_composition, 0), "inert part", "biomass"),
    Quantity("biomass_density_min", "least biomass density over X_m",
             "least (X_A + X_I) / X_m: means over curved triangles, or at nodes of straight ones",
             partial(_composition, 1), "least", "biomass"),
    Quantity("biomass_density_max", "largest biomass density over X_m",
             "largest (X_A + X_I) / X_m: means over curved triangles, or at nodes of straight ones",
             partial(_composition, 2), "largest", "biomass"),
    *_both("{}_min_mg_per_L", "least {} concentration", "least C at the nodes", _least),
    *_both("{}_overshoot_mg_per_L", "{} concentration above the supply",
           "largest C at the nodes - C_supply (with Gear: the largest of the table), at least zero",
           _overshoot, signed=False),
    *_both("{}_balance", "relative defect of the {}'s balance",
           "(supplied - leaving - consumed - stored) / scale; the worst of the steps since the "
           "last row and, except with Gear, of the row's own fluxes. scale: the largest of "
           "supplied, consumed, 1e6 times the round-off and, with Gear, the content of the "
           "meshed part at the supply", _substrate_balance, jumps=""),
    Quantity("biomass_balance", "relative defect of the biomass's balance",
             "(after - before - made) / after, the worst of the steps since the last row",
             lambda scene, at: _of_steps(balance.biomass, at), "biomass", "growth",
             signed=True),
    Quantity("oxygen_demand_balance",
             "relative defect of the oxygen demand's balance",
             "(biomass made - Y donor + (acceptor - F donor) / d_c) / scale, with the acceptor and "
             "the donor that a step consumes (7)-(10); the worst of the steps since the last row. "
             "scale: the largest of the two terms and 1e-7 of the biomass",
             lambda scene, at: _of_steps(partial(balance.oxygen_demand, scene.kinetics), at),
             "oxygen demand", "growth", signed=True),
    Quantity("surface_stretch_min", "least elastic stretch along the aggregate's free surface",
             f"least of {STRETCH}, on edges farther from a contact line than {100 * BESIDE:g} % of "
             "the free surface's length; with the neo-Hookean energy it creases below "
             f"{CREASE:g}, and folds below {BIOT:g}",
             lambda scene, at: least_stretched(at.pore).least, "least stretch",
             "aggregate and growth"),
    *(Quantity(f"surface_stretch_min_{axis}_um", f"place of the least surface stretch, {axis}",
               "middle of the edge with the least elastic stretch along the free surface",
               lambda scene, at, k=k: least_stretched(at.pore).place[k], f"{axis} of least stretch",
               "aggregate and growth", signed=True) for k, axis in enumerate("xy")),
    *_peak("wall_traction_max", "largest traction that a wall must bear",
           "largest (max(pull, 0)^2 + shear^2)^(1/2), means over W / 20 along the contact surface",
           "wall traction",
           partial(_adhesion, "wall_peak")),
    *_peak("tensile_stress_max", "largest tensile stress of the aggregate",
           "largest eigenvalue of the Cauchy stress, in a mean around a node with the weight 1 - "
           "(d / L)^2 at a distance d < L = W / 20", "tensile stress",
           partial(_adhesion, "tensile_peak")),
    *(Quantity(f"fluid_force_{axis}_uN_per_m", f"force of the fluid on the aggregate, {axis}",
               "integral of the water's stress over the interface, or of its drag over a permeable "
               "aggregate; the head is zero at the outlet of the meshed part",
               _all(partial(_load, axis), sum), f"force {axis}", "adhesion and flow", signed=True,
               jumps="flow")
      for axis in "xy"),
    Quantity("fluid_moment_nN", "moment of the fluid on the aggregate, per depth",
             "integral of x f_y - y f_x from the middle of the contact with its wall; of several, "
             "the sum",
             _all(partial(_load, "moment"), sum), "moment", "adhesion and flow", signed=True,
             jumps="flow"),
    Quantity("nodes", "nodes of the mesh", "corners, and middles of the sides of curved triangles",
             lambda scene, at: len(at.pore.mesh.points), "nodes"),
    Quantity("remeshed", "new mesh", "1 if a new mesh was generated since the last row, else 0",
             lambda scene, at: int(at.remeshes > 0 or at.new_mesh), yes_no=True),
    Quantity("contact", "contact with the opposite wall",
             "1 if an aggregate touches both walls, else 0",
             lambda scene, at: int(at.pore.contact), yes_no=True),
)

#: Columns of a scene with kinetics, after ``SERIES``: runs of earlier versions do not have them.
RATES = (
    *(Quantity(f"{name}_uptake_ug_per_m_per_h", f"uptake of the {name}",
               "integral of (7)-(8) over the aggregates, at the present concentrations",
               _all(partial(_uptake, k), sum), f"{name} uptake", f"{name} and biomass", signed=True,
               jumps=AT_REST)
      for k, name in enumerate(SUBSTRATES)),
    Quantity("biomass_growth_ug_per_m_per_h", "net growth of the biomass",
             "integral of (9) + (10) over the aggregates, at the present concentrations",
             _growth, "net growth", "biomass and substrates", signed=True, jumps=AT_REST),
)

def _total(name: str, of: Quantity) -> Quantity:
    """The total of a quantity per depth, by the depth of the pore."""
    words = of.words.replace("area", "volume")
    return replace(of, name=name, words=f"{words}, over the depth",
                   formula=f"{of.name} times pore.depth",
                   value=lambda scene, at: scene.pore.depth * of.value(scene, at))


_PER_DEPTH = {quantity.name: quantity for quantity in (*SERIES, *RATES)}
#: Columns of a scene with a depth.
TOTALS = (
    Quantity("flow_rate_uL_per_min", "flow rate",
             "u_ave W pore.depth, of the whole pore: with 2 W up to a plane of symmetry",
             lambda scene, at: (scene.pore.depth * scene.pore.whole_width
                                * _PER_DEPTH["mean_velocity_m_per_d"].value(scene, at)),
             "flow rate", "flow", jumps="flow"),
    _total("aggregate_volume_um3", _PER_DEPTH["aggregate_area_um2"]),
    *(_total(f"{name}_pg_per_h", _PER_DEPTH[f"{name}_ug_per_m_per_h"])
      for name in (*(f"{substrate}_uptake" for substrate in SUBSTRATES), "biomass_growth")),
    *(_total(f"fluid_force_{axis}_nN", _PER_DEPTH[f"fluid_force_{axis}_uN_per_m"])
      for axis in "xy"),
)

#: Columns of each aggregate of a scene with several: value takes its place in the pore's list, the
#: scene and a Report. NAME is its name, or its number from one. They are empty once it has left.
BODY = (
    Quantity("aggregate_NAME_area_um2", "area", "area inside its boundary",
             partial(_of_outline, "area"), "area", "aggregate"),
    Quantity("aggregate_NAME_thickness_um", "thickness",
             "largest distance of its boundary from its wall", partial(_of_outline, "thickness"),
             "thickness", "aggregate"),
    *(Quantity(f"aggregate_NAME_{end}_um", f"{end} end", f"{extreme} x of its boundary",
               partial(_of_outline, end), f"{end} end", "aggregate", signed=True)
      for end, extreme in (("upstream", "smallest"), ("downstream", "largest"))),
    Quantity("aggregate_NAME_film_um", "thinnest film",
             "least thickness of the fluid between it and a wall that it does not touch; zero if "
             "it touches both", lambda k, scene, at: (
                 0.0 if at.pore.bodies[k].spans else at.pore.outlines[k].gap(at.pore.mesh.walls)),
             "film", "aggregate"),
    Quantity("aggregate_NAME_gap_um", "distance from another aggregate",
             "least thickness of the fluid between it and another one", lambda k, scene, at: min(
                 (at.pore.outlines[k].film(other)[0]
                  for number, other in enumerate(at.pore.outlines) if number != k), default=None),
             "gap", "aggregate"),
    *(Quantity(f"aggregate_NAME_{wall}_contact_um", f"contact with the {wall} wall",
               "length of its contact surface there",
               lambda k, scene, at, number=number: at.pore.outlines[k].contact_length(
                   numbered(at.pore.mesh.walls, number)),
               f"{wall} contact", "aggregate")
      for wall, number in (("lower", BOTTOM), ("upper", TOP))),
    Quantity("aggregate_NAME_biomass_pg_per_m", "biomass", "integral of X_A + X_I",
             lambda k, scene, at: at.pore.bodies[k].mass, "biomass", "biomass"),
    *(Quantity(f"aggregate_NAME_{name}_uptake_ug_per_m_per_h", f"uptake of the {name}",
               "integral of (7)-(8) over it, at the present concentrations", partial(_uptake, k),
               f"{name} uptake", f"{name} and biomass", signed=True, jumps=AT_REST)
      for k, name in enumerate(SUBSTRATES)),
    Quantity("aggregate_NAME_eroded_ug_per_m_per_h", "erosion",
             "X_m times the integral of the speed of erosion over its free surface, in the present "
             "flow", _eroded, "erosion", "erosion"),
    Quantity("aggregate_NAME_surface_stretch_min",
             "least elastic stretch along the free surface", "as surface_stretch_min",
             lambda k, scene, at: surfaces(at.pore)[k].least, "least stretch", "growth"),
    *_peak("aggregate_NAME_wall_traction_max", "largest traction that a wall must bear",
           "as wall_traction_max_MPa", "wall traction",
           lambda k, *of: _adhesion("wall_peaks", *of)[k]),
    *_peak("aggregate_NAME_tensile_stress_max", "largest tensile stress",
           "as tensile_stress_max_MPa", "tensile stress",
           lambda k, *of: _adhesion("tensile_peaks", *of)[k]),
    *(Quantity(f"aggregate_NAME_fluid_force_{axis}_uN_per_m", f"force of the fluid, {axis}",
               f"as fluid_force_{axis}_uN_per_m", partial(_load, axis), f"force {axis}",
               "adhesion and flow", signed=True, jumps="flow") for axis in "xy"),
)


def of_body(quantity: Quantity, label: str) -> Quantity:
    """A quantity of ``BODY`` for the aggregate with a name; None if it is not in the pore."""
    def value(scene: Scene, at: Report) -> float | None:
        names = [body.name for body in at.pore.bodies]
        return quantity.value(names.index(label), scene, at) if label in names else None

    return replace(quantity, name=quantity.name.replace("NAME", label), value=value,
                   words=f"{quantity.words}, aggregate {label}",
                   label=f"{quantity.label}, {label}")


def series(scene: Scene) -> tuple[Quantity, ...]:
    """The quantities of ``timeseries.csv`` of a scene: ``SERIES``, ``RATES`` with kinetics,
    ``TOTALS`` with a depth, and ``BODY`` for each of several aggregates."""
    labels = scene.labels if len(scene.aggregates) > 1 else []
    rates = RATES if scene.kinetics else ()
    totals = TOTALS if scene.pore.depth else ()
    bodies = (of_body(quantity, label) for label in labels for quantity in BODY)
    return *SERIES, *rates, *totals, *bodies


def column_names(scene: Scene) -> list[str]:
    """The columns of ``timeseries.csv`` of a scene."""
    return [quantity.name for quantity in series(scene)]


#: Parts of a substrate's ledger: label and formula.
PARTS = {"supplied": ("supplied", "supply times the flow through the inlet, over the step"),
         "out": ("leaving", "integral of u_x C over the outlet, over the step"),
         "consumed": ("taken up", "uptake (7)-(8) over the aggregate and the step"),
         "stored": ("stored", "content of the meshed part at the step's end - at its start; zero "
                              "if substrates are quasi-steady"),
         "unmet": ("unmet", "demand of decay without acceptor over the aggregate and the step, "
                            "with kinetics.decay = unlimited; else zero")}

#: Columns of ``ledger.csv``: value takes the scene and a Ledger. Per metre of depth, 1 um2 mg/L is
#: 1 pg/m.
LEDGER = (
    Quantity("start_h", "start of the step", "t", lambda scene, step: step.start),
    Quantity("end_h", "end of the step", "t", lambda scene, step: step.end),
    *(Quantity(f"{name}_{part}_pg_per_m", f"{name} {label}", formula,
               lambda scene, step, part=part, k=k: getattr(step, part)[k], label, name,
               signed=True)
      for k, name in enumerate(SUBSTRATES) for part, (label, formula) in PARTS.items()),
    Quantity("biomass_before_pg_per_m", "biomass at the step's start",
             "integral of X_A + X_I over the aggregate",
             lambda scene, step: step.biomass_before, "before"),
    Quantity("biomass_made_pg_per_m", "biomass made", "integral of (9) + (10) over the step",
             lambda scene, step: step.biomass_made, "made", signed=True),
    Quantity("biomass_after_pg_per_m", "biomass at the step's end",
             "integral of X_A + X_I over the aggregate, in its new shape and on its new mesh",
             lambda scene, step: step.biomass_after, "after"),
    Quantity("oxygen_demand_balance",
             "relative defect of the oxygen demand's balance",
             "as in timeseries.csv, of the step",
             lambda scene, step: balance.oxygen_demand(scene.kinetics, step), "oxygen demand",
             signed=True),
)

#: The column of a ledger whose scene continues after detachment, or has erosion.
DETACHED = Quantity("detached_pg_per_m", "detached biomass, which leaves in the step",
                    "integral of X_A + X_I over what the surfaces pass, and over the aggregates "
                    "that detach; the biomass at the step's end is without it",
                    lambda scene, step: step.detached, "detached")

COLUMNS = [quantity.name for quantity in SERIES]
LEDGER_COLUMNS = [quantity.name for quantity in LEDGER]


def ledger_columns(scene: Scene) -> tuple[Quantity, ...]:
    """Columns of the ``ledger.csv`` of a scene."""
    growth = scene.growth
    return (*LEDGER, DETACHED) if growth and (growth.continues or growth.erosion) else LEDGER


def row(scene: Scene, instant: Report) -> dict[str, float | None]:
    """One row of ``timeseries.csv``: the geometry at its time, and flow and substrates in it."""
    return {quantity.name: quantity.reported(scene, instant)
            if is_modelled(quantity, NEEDS, scene, instant) else None
            for quantity in series(scene)}


def ledger_row(scene: Scene, ledger: Ledger) -> list[float | None]:
    """One row of ``ledger.csv``: a step's balances per metre of depth."""
    modelled = {"", *scene.substrates.modelled}
    return [quantity.reported(scene, ledger) if quantity.needs in modelled else None
            for quantity in ledger_columns(scene)]
