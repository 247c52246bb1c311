"""C38, C39, C47: statements of the introduction and the discussion that the paper does not compute.

C45: the uptake of an aggregate against that of layers with the same biomass.

A layer of uniform thickness covers one wall of the pore, or two layers with half of the biomass each cover both walls.
The model computes their uptake with the layers in place of the aggregate.

C44: the pore as a part of a network.
"""

from math import gamma

import numpy as np

from repro.fem.mesh import Mesh, curved
from repro.fem.mesher import unlocked
from repro.fem.walls import channel_walls
from repro.model.meshing import sized
from repro.model.uptake_law import Values
from repro.network.resistance import share_range
from repro.network.throats import added_resistance
from repro.scene import Scene
from verification.claims import FEW, FEW_WORDS, LATER, Finding, at_least, at_most, claim
from verification.claims.base_run import DISTANCES, upstream_means
from verification.claims.levels import ABOUT_WIDE, PAIRED
from verification.claims.permeability import CLOSING, LENGTHS, at_length, clean_per_day, layered_share
from verification.claims.runs import (
    BASE,
    PLOTTED,
    SUBSTRATES,
    WIDE,
    Body,
    Run,
    bodies,
    full_biomass,
    halved,
    load_packaged,
    series,
    solution,
)
from verification.problems.channels import pair

#: Conductivities over the clean channel's at which the biomass is compared.
REDUCED = (0.5, 0.1, 0.01)
#: The ratio at which the conductivities of equal biomass are compared.
SAME = 0.1
#: Thicknesses of a layer over the width that is left to it.
LAYERS = np.linspace(1e-4, 1.0, 4001)


@claim("C38", "1", "it takes less biomass to plug a pore if it forms aggregates than if it forms a continuous biofilm",
       date=LATER, **ABOUT_WIDE)
def less_biomass() -> Finding:
    """Biomass of a uniform layer on the lower wall, and of two layers on both, over that of the growing aggregate of
    wide, at equal conductivity of the 600 um pore: parallel flow in closed form."""
    scene = load_packaged(*WIDE)
    checks = [at_least(f"K / K_clean = {reduced:g}: biomass of layers on {walls} wall{'s' * (walls - 1)} over the "
                       "aggregate's", "less", filled(scene.flow.viscosity_ratio, reduced, walls) / filled_at(reduced),
                       1.0, "the words") for reduced in REDUCED for walls in (1, 2)]
    checks += [at_least(f"{name}: K / K_clean = {SAME:g}: biomass of a layer over the aggregate's, in a pore of "
                        f"{lengths:g} W", "less", filled(scene.flow.viscosity_ratio, SAME, 1) / filled_at(
                            SAME, run, lengths), 1.0, "the words")
               for name, run in (("wide", WIDE), ("base", CLOSING)) for lengths in LENGTHS]
    same = filled_at(SAME)
    checks += [at_least(f"the part filled with which the aggregate has K / K_clean = {SAME:g}: that of layers on "
                        f"{walls} wall{'s' * (walls - 1)} over it", "crucial to model permeability reduction",
                        layered_share(scene.flow.viscosity_ratio, same, walls) / SAME, 1 + FEW,
                        f"porosity does not determine it: more than {FEW_WORDS}") for walls in (1, 2)]
    return Finding(tuple(checks), reason="less biomass plugs as a layer, or porosity determines the permeability")


def filled_at(reduced: float, run: Run = WIDE, lengths: float | None = None) -> float:
    """Share of the pore that the aggregate of a run fills when it has reduced the conductivity to a part; lengths: of
    the pore over its width, by default the run's own."""
    scene, rows = load_packaged(*run), series(*run)
    lengths = lengths or scene.pore.length / scene.pore.width
    share = at_length(rows["conductivity_m_per_d"] / clean_per_day(scene), scene, lengths)
    area = np.exp(np.interp(-np.log(reduced), -np.log(share), np.log(rows["aggregate_area_um2"])))
    return float(area) / (scene.pore.width**2 * lengths)


def filled(ratio: float, reduced: float, walls: int) -> float:
    """Share of a channel that uniform layers on one or both walls fill when its conductivity is reduced to a part."""
    shares = np.array([layered_share(ratio, part, walls) for part in LAYERS])
    return float(np.interp(-reduced, -shares, LAYERS))


@claim("C39", "5", "a mass transfer coefficient cannot be set a priori: it depends on the sink in the solid",
       date="2026-11-24 13:01")
def depends_on_the_sink() -> Finding:
    """Sherwood numbers of one shape in one flow with three sinks of the model: nearly of first order (small supply),
    nearly of zero order (large supply), and with a maximum rate of FASTER times that of Table 1. The drop of the
    concentration starts at the pore's supply, or in the water at one of BULK from the aggregate."""
    shapes = [in_one_shape(supply=supply) for supply in SINKS] + [in_one_shape(supply=SINKS[0], faster=FASTER)]
    numbers = {place: np.array([sherwood(shape, distance) for shape in shapes]) for place, distance in BULK.items()}
    checks = tuple(at_least(f"{name}, {place}: Sherwood numbers of three sinks, largest over smallest less one (%)",
                            "depends on the sink in the solid", value, 100 * FEW, FEW_WORDS)
                   for place, sinks in numbers.items() for name, value in zip(SUBSTRATES, spread_in_percent(sinks)))
    kinds = (*(f"with supplies of {supply:g} K_s" for supply in SINKS), f"with k times {FASTER:g}")
    rows = "; ".join(f"{a:.3g} and {d:.3g} {kind}" for kind, (a, d) in zip(kinds, numbers["supply"]))
    return Finding(checks, reason="with the drop from the pore's supply most of it is in the water upstream, which no "
                   "sink changes", note=f"Sherwood numbers of acceptor and donor, from the supply, of a half-disc of "
                   f"{RADIUS:g} um in the flow of 1e-3 cm: {rows}.")


#: Distance (um) upstream of the aggregate at which the paper names a concentration (C05).
AWAY = DISTANCES[0]


@claim("C47", "4", "the aggregate enhances its transport, which shows how difficult it is to set a mass transfer "
       "coefficient a priori", date="2026-11-30 10:45")
def hard_to_set() -> Finding:
    """Sherwood numbers of base from t = 0 to 19.2 h: uptake over interface and drop of the concentration from the
    supply to the interface's mean, times thickness over diffusivity in water. The enhanced transport is the diffusive
    flux towards the aggregate, 60 um upstream, over the advective one: the supply less the mean concentration there,
    over this concentration. The note has Leveque's numbers of a flat patch that is as long as the aggregate; they need
    large Peclet numbers, and this one is about 3. That the coefficient depends on shape and flow is our reading; the
    paper names the "boundary conditions, especially the sink term in the solid" (section 5, C39)."""
    early = [aggregate for aggregate in bodies(BASE) if aggregate.pore.time <= PLOTTED + 1e-6]
    numbers, textbook = np.array([*map(sherwood, early)]), leveque_numbers(early[-1])
    pore, solved = early[-1].pore, early[-1].solved
    supply, away = np.array(pair("supply", solved.problem.substrates)), upstream_means(pore, solved, AWAY)
    rows = (("largest over smallest Sherwood number, less one (%)", "cannot be set", spread_in_percent(numbers)),
            (f"diffusive over advective flux {AWAY:g} um upstream, 19.2 h (%)", "enhancement of transport",
             100 * (supply / away - 1)))
    checks = tuple(at_least(f"{name}: {quantity}", words, value, 100 * FEW, FEW_WORDS)
                   for quantity, words, values in rows for name, value in zip(SUBSTRATES, values))
    patch = " and ".join(f"{value:.3g}" for value in textbook / numbers[-1])
    return Finding(checks, reason="it does not depend on shape or flow by more than a few percent",
                   note="That it depends on shape and flow is our reading; section 5 names the boundary conditions, "
                        f"and especially the sink (C39). Leveque's numbers are {patch} times ours at 19.2 h.")


def spread_in_percent(numbers: np.ndarray) -> np.ndarray:
    """(2,) largest over smallest of the numbers (n, 2) of both substrates, less one, in percent."""
    return 100 * (numbers.max(axis=0) / numbers.min(axis=0) - 1)


#: Supplies of both (K_s) of two sinks, nearly of first and of zero order; and the half-disc's radius (um).
SINKS, RADIUS = (1.0, 100.0), 25.0
#: The rate over that of Table 1 of the fastest sink.
FASTER = 100.0


def in_one_shape(radius: float = RADIUS, supply: float = 10.0, head: float = 1e-3, faster: float = 1.0) -> Body:
    """A half-disc of a radius (um) in the pore of base at rest, under a head (cm), with both supplies (mg/L) and a
    maximum rate over that of Table 1."""
    supplies = (f'substrates.{name}.supply="{supply!r} mg/L"' for name in SUBSTRATES)
    return bodies(("base", 'growth.end="0 h"', f'aggregate.radius="{radius!r} um"', f'flow.head="{head!r} cm"',
                   f'kinetics.maximum_utilization_rate="{9.3 * faster!r} 1/day"', *supplies))[0]


#: Places of the bulk concentration: distances (um) upstream of the aggregate; None is the pore's supply.
BULK = {"supply": None, "25 um upstream": 25.0, "10 um upstream": 10.0, "its edge": 0.0}


def sherwood(aggregate: Body, distance: float | None = None) -> np.ndarray:
    """Sherwood numbers (2,) of both substrates; distance: of the bulk upstream of the aggregate (um), see BULK."""
    outline, edges = aggregate.outline, aggregate.outline.interface_edges()
    bulk, diffusivity = (np.array(pair(name, aggregate.scene.substrates)) for name in ("supply", "diffusivity"))
    if distance is not None:
        bulk = upstream_means(aggregate.pore, aggregate.solved, distance)
    drop = bulk - [aggregate.concentration(name)[aggregate.grid.loop[edges]].mean() for name in SUBSTRATES]
    uptake = np.array([flux.supplied - flux.out for flux in aggregate.solved.fluxes])
    return uptake / (outline.edge_lengths()[edges].sum() * drop) * outline.thickness / diffusivity


def leveque_numbers(aggregate: Body) -> np.ndarray:
    """Sherwood numbers (2,) of a flat patch on the wall, as long as the aggregate (Leveque), with the aggregate's
    thickness."""
    outline, shear = aggregate.outline, 6 * aggregate.solved.flow.mean_velocity / aggregate.grid.width
    patch = outline.downstream - outline.upstream
    diffusivities = np.array(pair("diffusivity", aggregate.solved.problem.substrates))
    return leveque(shear, patch, diffusivities) * outline.thickness / patch


def leveque(shear: float, length: float, diffusivity: Values) -> Values:
    """Mean Sherwood number, by its length, of a patch on a wall with constant concentration in a shear flow, at large
    Peclet numbers: 3/2 (G l^2 / D)^(1/3) / (9^(1/3) Gamma(4/3)), that is 0.807 (G l^2 / D)^(1/3)."""
    return 1.5 * (shear * length**2 / diffusivity / 9) ** (1 / 3) / gamma(4 / 3)


#: Layers in the model's pore: distance (um) of their ends from the ends of the pore, and the least number of elements
#: across a layer.
MARGIN, FEWEST = 2.0, 4


@claim("C45", "1", "continuous or patchy, the distinction is not crucial in modelling the consumption of substrates",
       date="2026-11-24 12:50", **ABOUT_WIDE,
       unjudged="the paper cites a judgement of Rittmann and gives no number for crucial")
def not_crucial() -> Finding:
    """Share of the supplied acceptor that the aggregate of wide takes up when it has reduced the conductivity to
    several parts. Layers of the same biomass, on one wall or on both, are compared with it at the same mean velocity
    and supply."""
    rows = []
    for reduced in REDUCED:
        part = filled_at(reduced)
        one_layer, two_layers = (100 * share_of_layers(part, walls) for walls in (1, 2))
        rows.append(f"{100 * share_of_aggregate(part):.0f}, {one_layer:.0f} and {two_layers:.0f} % with "
                    f"{100 * part:.1f} % of the pore filled")
    return Finding((), note="Of the acceptor supplied, the aggregate, a layer on one wall and layers on both walls "
                   f"take up with the same biomass: {'; '.join(rows)}.")


def shares(rows: dict[str, np.ndarray]) -> np.ndarray:
    """(n,) parts of the acceptor supplied, 10 mg/L, that an aggregate takes up, from the columns of its run."""
    return 1 - rows["effluent_acceptor_mg_per_L"] / 10.0


def share_of_aggregate(part: float) -> float:
    """Part of the acceptor supplied that the aggregate of wide takes up when it fills a part of the pore."""
    scene, rows = load_packaged(*WIDE), series(*WIDE)
    return float(np.interp(part, rows["aggregate_area_um2"] / (scene.pore.width * scene.pore.length), shares(rows)))


def share_of_layers(part: float, walls: int) -> float:
    """The same share of layers on one wall or on both, computed by the model."""
    scene = load_packaged(*WIDE)
    grid = layered(scene, part, walls)
    _, fluxes = solution(scene, grid, full_biomass(scene, grid))
    return 1 - fluxes[0].effluent / scene.substrates.acceptor.supply


def layered(scene: Scene, part: float, walls: int) -> Mesh:
    """A mesh of the whole pore, of which layers of equal thickness on one or both walls fill a part; they end MARGIN
    from its ends, to let in the flow."""
    width, end = scene.pore.width, 0.5 * scene.pore.length
    size = sized(scene).largest
    height = part * width / walls * end / (end - MARGIN)
    y = evenly((0.0, height, width) if walls == 1 else (0.0, height, width - height, width), size)
    x = evenly((-end, MARGIN - end, end - MARGIN, end), size)
    points = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    cells = halved(np.arange(len(points)).reshape(len(x), len(y)))
    middle_x, middle_y = points[cells].mean(axis=1).T
    biomass = (np.abs(middle_x) < end - MARGIN) & ((middle_y < height) | (middle_y > width - (walls - 1) * height))
    grid = unlocked(Mesh.of(points, cells, biomass, (), channel_walls(width), (-end, end)))
    return grid if scene.numerics.scheme.order == 1 else curved(grid, None)


def evenly(ends: tuple[float, ...], size: float) -> np.ndarray:
    """Coordinates from the first end to the last. They divide each part into at least FEWEST intervals, none longer
    than ``size``."""
    parts = [np.linspace(low, high, 1 + max(FEWEST, int(np.ceil((high - low) / size))))
             for low, high in zip(ends, ends[1:])]
    return np.unique(np.concatenate(parts))


#: The least A / W^2; the thickness is then a quarter of W. In the scheme of 2001 a smaller aggregate adds less
#: resistance than the error of the empty channel.
LEAST = 0.1


@claim("C44", "5", "the model of a pore can be incorporated into a network model", date="2026-11-29 23:14",
       fine=PAIRED, beside=())
def for_networks() -> Finding:
    """Added resistance of the aggregates of base and wide against the law for networks, which was not fitted to
    them. "Can": one scene within the law's bound is enough. The values were known when it was judged: 0.022, 0.32 and
    0.37 of the bound."""
    rows = {"base": deviation_over_bound(BASE, False), "wide before contact": deviation_over_bound(WIDE, False),
            "wide after contact": deviation_over_bound(WIDE, True)}
    parts = ", ".join(f"{np.abs(values).max():.2g} ({name})" for name, values in rows.items())
    least = min(np.abs(values).max() for values in rows.values())
    check = at_most("largest ln(r / law's r) over that of the law's bound, the least of three states",
                    "can be incorporated", least, 1, "one scene within the law's bound")
    return Finding((check,), reason="no aggregate is within the law's bound",
                   change="the paper leaves the network to a companion paper; the law and its bound are ours",
                   note="r is the length of empty pore, over W, that resists as much as the aggregate adds. The "
                   "law `repro.added_resistance` gives it from A / W^2, lambda and whether the pore is spanned. "
                   f"Largest ln(r / law's r) over that of the law's bound: {parts}.")


def deviation_over_bound(run: tuple[str, ...], spanned: bool) -> np.ndarray:
    """(n,) ln(r / law's r) over ln of the law's bound on the same side, for the rows of a run in the law's range, from
    LEAST on."""
    scene, rows = load_packaged(*run), series(*run)
    width = scene.pore.width
    low, high = share_range(spanned)
    share = rows["aggregate_area_um2"] / width**2
    in_range = (rows["contact"] == spanned) & (share >= max(low, LEAST)) & (share <= high)
    added = clean_per_day(scene) / rows["conductivity_m_per_d"][in_range] - 1
    law, least, largest = np.log(added_resistance(share[in_range], 1.0, spanned, scene.flow.viscosity_ratio))
    deviation = np.log(added * scene.pore.length / width) - law
    return deviation / np.where(deviation < 0, law - least, largest - law)
