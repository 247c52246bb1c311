"""C38, C39: what the paper says in its introduction and discussion, and does not compute.

C45: what an aggregate takes up, beside layers that have its biomass.

A layer of uniform thickness covers a wall of the whole pore, or both of them half each. The model judges, with such
layers as its aggregate. Where a section mixes faster than it is passed, W^2 / D against L / u, and layers are thin,
X q h^2 < D C, concentrations hang on x alone, and what the model makes of it is told beside:

    u C' = D_mean C'' - X f q(C_A, C_D),     D_mean = (1 - f) D + f D_B,     f the share of the pore that is biomass

with (11) and (12): a strip crossed by plug flow, the pore itself (`reference.channel_bvp`). It does not tell one layer
from two, and a layer on one wall takes up several percent less.

C44: the pore as a part of a network.
"""

from dataclasses import replace
from math import gamma

import numpy as np

from reference import channel_bvp, layered_channel
from repro.fem.mesh import Mesh, curved
from repro.fem.mesher import unlocked
from repro.model.pore import sized
from repro.model.uptake_law import Values
from repro.results.network import added_resistance, known
from repro.scene import Scene
from verification.claims import FEW, FEW_WORDS, LATER, Finding, at_least, at_most, between, claim
from verification.claims.levels import ABOUT_WIDE
from verification.claims.permeability import clean
from verification.claims.pore_ends import holding
from verification.claims.runs import (
    BASE,
    PLOTTED,
    SUBSTRATES,
    WIDE,
    Body,
    bodies,
    full_biomass,
    halved,
    load_packaged,
    series,
    solution,
)
from verification.problems.channels import pair, rates

#: Conductivities over the clean channel's at which the biomass is compared.
REDUCED = (0.5, 0.1, 0.01)
#: The one at which the conductivities of equal biomass are compared.
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
    same = filled_at(SAME)
    checks += [at_least(f"the part filled with which the aggregate has K / K_clean = {SAME:g}: that of layers on "
                        f"{walls} wall{'s' * (walls - 1)} over it", "crucial to model permeability reduction",
                        layered_share(scene.flow.viscosity_ratio, same, walls) / SAME, 1 + FEW,
                        f"porosity does not determine it: more than {FEW_WORDS}") for walls in (1, 2)]
    return Finding(tuple(checks), reason="a layer plugs with less, or porosity determines the permeability")


def filled_at(reduced: float) -> float:
    """Share of the pore that the aggregate of wide fills when it has reduced the conductivity to a part."""
    scene, rows = load_packaged(*WIDE), series(*WIDE)
    share = rows["conductivity_m_per_d"] / (24e-6 * clean(scene))
    area = np.exp(np.interp(-np.log(reduced), -np.log(share), np.log(rows["aggregate_area_um2"])))
    return float(area) / (scene.pore.width * scene.pore.length)


def filled(ratio: float, reduced: float, walls: int) -> float:
    """Share of a channel that uniform layers on one or both walls fill when its conductivity is reduced to a part."""
    shares = np.array([layered_share(ratio, part, walls) for part in LAYERS])
    return float(np.interp(-reduced, -shares, LAYERS))


def layered_share(ratio: float, part: float, walls: int) -> float:
    """K / K_clean of a channel of which layers fill a part: Poiseuille's gradient over that of parallel flow at the
    same mean velocity."""
    if walls == 1:
        return float(12.0 / layered_channel.gradient(1.0, part, ratio))
    open_ = 1.0 - part
    return open_**3 + (1.0 - open_**3) / ratio


@claim("C39", "5", "a mass transfer coefficient cannot be set a priori: it depends on the sink in the solid",
       date=LATER)
def mass_transfer() -> Finding:
    """Sherwood numbers of base from t = 0 to 19.2 h: uptake over interface and drop of the concentration from the
    supply to the interface's mean, times thickness over diffusivity in water. Beside them a textbook's, that of a flat
    patch as long as the aggregate; and those of one shape in one flow with little and with much supply, whose sinks are
    nearly of first and of zero order, and with nothing left at the surface, the limit of ever faster uptake."""
    early = [aggregate for aggregate in bodies(BASE) if aggregate.pore.time <= PLOTTED + 1e-6]
    numbers, textbook = np.array([sherwood(aggregate) for aggregate in early]), textbooks(early[-1])
    shape = [in_one_shape(supply=supply) for supply in SINKS]
    sinks = np.array([*map(sherwood, shape), sherwood(at_the_surface(shape[0]))])
    rows = {"{}: largest over smallest Sherwood number, less one (%)": ("cannot be set", differing(numbers)),
            "{}, 19.2 h: Leveque's number over ours, less one, either way (%)":
                ("cannot be set", 100 * np.abs(textbook / numbers[-1] - 1)),
            "{}, one shape and flow: Sherwood numbers of three sinks, largest over smallest less one (%)":
                ("depends on the sink in the solid", differing(sinks))}
    checks = tuple(at_least(quantity.format(name), scene, value, 100 * FEW, FEW_WORDS)
                   for quantity, (scene, values) in rows.items() for name, value in zip(SUBSTRATES, values))
    kinds = (*(f"with supplies of {supply:g} K_s" for supply in SINKS), "with nothing left at the surface")
    shapes = "; ".join(f"{a:.3g} and {d:.3g} {kind}" for kind, (a, d) in zip(kinds, sinks))
    fast = sherwood(in_one_shape(supply=SINKS[0], faster=FASTER))[0]
    note = (f"Sherwood numbers of acceptor and donor of a half-disc of {RADIUS:g} um in the flow of 1e-3 cm: {shapes}. "
            "The sink moves the number by little more than a few percent, since most of the drop is in the water "
            f"upstream. Changed on {LATER} after these values had been seen: the third sink was k times {FASTER:g}, "
            f"which gives {fast:.4g} for the acceptor and is not yet the surface alone; with it the acceptor's number "
            f"moves by {100 * (sinks[:, 0].max() / fast - 1):.1f} %, which the same 5 % called contradicted.")
    return Finding(checks, reason="it does not hang on shape, flow or sink by more than a few percent", note=note)


def differing(numbers: np.ndarray) -> np.ndarray:
    """(2,) largest over smallest of the numbers (n, 2) of both substrates, less one, in percent."""
    return 100 * (numbers.max(axis=0) / numbers.min(axis=0) - 1)


#: Supplies of both (K_s) of two sinks, nearly of first and of zero order; and the half-disc's radius (um).
SINKS, RADIUS = (1.0, 100.0), 25.0
#: The rate over that of Table 1 that was taken for a sink at the surface.
FASTER = 100.0


def at_the_surface(aggregate: Body) -> Body:
    """The same with both concentrations held at nothing in the aggregate: a sink at its surface alone."""
    return replace(aggregate, solved=holding(aggregate.pore, aggregate.solved, aggregate.grid.body, 0.0))


def in_one_shape(radius: float = RADIUS, supply: float = 10.0, head: float = 1e-3, faster: float = 1.0) -> Body:
    """A half-disc of a radius (um) in the pore of base at rest, under a head (cm), with both supplies (mg/L) and a
    maximum rate over that of Table 1."""
    supplies = (f'substrates.{name}.supply="{supply!r} mg/L"' for name in SUBSTRATES)
    return bodies(("base", 'growth.end="0 h"', f'aggregate.radius="{radius!r} um"', f'flow.head="{head!r} cm"',
                   f'kinetics.maximum_utilization_rate="{9.3 * faster!r} 1/day"', *supplies))[0]


def sherwood(aggregate: Body) -> np.ndarray:
    """(2,) of both substrates."""
    outline, edges = aggregate.outline, aggregate.outline.interface_edges()
    supply, diffusivity = (np.array(pair(name, aggregate.scene.substrates)) for name in ("supply", "diffusivity"))
    drop = supply - [aggregate.concentration(name)[aggregate.grid.loop[edges]].mean() for name in SUBSTRATES]
    uptake = np.array([flux.supplied - flux.out for flux in aggregate.solved.fluxes])
    return uptake / (outline.edge_lengths()[edges].sum() * drop) * outline.thickness / diffusivity


def textbooks(aggregate: Body) -> np.ndarray:
    """The same of a flat patch on the wall, as long as the aggregate (Leveque), with the aggregate's thickness."""
    outline, shear = aggregate.outline, 6 * aggregate.solved.flow.mean_velocity / aggregate.grid.width
    patch = outline.downstream - outline.upstream
    diffusivities = np.array(pair("diffusivity", aggregate.solved.problem.substrates))
    return leveque(shear, patch, diffusivities) * outline.thickness / patch


def leveque(shear: float, length: float, diffusivity: Values) -> Values:
    """Mean Sherwood number, by its length, of a patch on a wall with constant concentration in a shear flow, at large
    Peclet numbers: 3/2 (G l^2 / D)^(1/3) / (9^(1/3) Gamma(4/3)), that is 0.807 (G l^2 / D)^(1/3)."""
    return 1.5 * (shear * length**2 / diffusivity / 9) ** (1 / 3) / gamma(4 / 3)


#: "Not crucial": a tenth, as what is small in C26.
NOT_CRUCIAL = 0.1
#: Of layers in the model's pore, um: the distance of their ends from those of the pore; fewest elements across one.
MARGIN, FEWEST = 2.0, 4


@claim("C45", "1", "continuous or patchy, the distinction is not crucial in modelling the consumption of substrates",
       date=LATER, **ABOUT_WIDE)
def not_crucial() -> Finding:
    """Acceptor taken up by the aggregate of wide over that of a layer on one wall and of two on both with its biomass,
    at the same mean velocity and supply, when it has reduced the conductivity to given parts."""
    scene = load_packaged(*WIDE)
    checks, uptake_shares = [], []
    apart = []
    for reduced in REDUCED:
        part = filled_at(reduced)
        share, layers = aggregates_share(part), [in_the_model(part, walls) for walls in (1, 2)]
        checks += [between(f"K / K_clean = {reduced:g}: acceptor taken up over that of layers on {walls} "
                           f"wall{'s' * (walls - 1)}", "not crucial", share / other, 1 - NOT_CRUCIAL, 1 + NOT_CRUCIAL,
                           "not crucial: within a tenth") for walls, other in zip((1, 2), layers)]
        uptake_shares.append(f"{100 * share:.0f} % against {100 * layers[0]:.0f} and {100 * layers[1]:.0f} % of the "
                             f"supply with {100 * part:.1f} % filled")
        apart.append("{:.3f} and {:.3f}".format(*np.array(layers) / layers_share(scene, part)))
    reason = "an aggregate lets more of the supply pass than layers of the same biomass do: " + "; ".join(uptake_shares)
    return Finding(tuple(checks), reason=reason, note=f"Changed on {LATER} after these values had been seen: layers "
                   "mixed over a section were judged with, of whose uptake the model's have, on one wall and on both, "
                   f"{'; '.join(apart)}; the verdict was the same.")


def shares(rows: dict[str, np.ndarray]) -> np.ndarray:
    """(n,) parts of the acceptor supplied, 10 mg/L, that an aggregate takes up, from the columns of its run."""
    return 1 - rows["effluent_acceptor_mg_per_L"] / 10.0


def aggregates_share(part: float) -> float:
    """Part of the acceptor supplied that the aggregate of wide takes up when it fills a part of the pore."""
    scene, rows = load_packaged(*WIDE), series(*WIDE)
    return float(np.interp(part, rows["aggregate_area_um2"] / (scene.pore.width * scene.pore.length), shares(rows)))


def layers_share(scene: Scene, part: float) -> float:
    """Part of the acceptor supplied that layers take up which fill a part of the pore."""
    supply = pair("supply", scene.substrates)
    water, inside = (np.array(pair(name, scene.substrates)) for name in ("diffusivity", "diffusivity_in_aggregate"))
    mean = (1 - part) * water + part * inside
    density = part * scene.kinetics.maximum_density
    concentrations = channel_bvp.solve(scene.flow.mean_velocity, supply, mean, mean, density,
                                       rates(scene.kinetics, scene.substrates), scene.pore.length)
    return 1 - float(concentrations(np.array([scene.pore.length]))[0, 0]) / supply[0]


def in_the_model(part: float, walls: int) -> float:
    """The same of the model, layers on one or both walls as its aggregate."""
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
    grid = unlocked(Mesh.of(points, cells, biomass, np.empty(0, int), width, (-end, end)))
    return grid if scene.numerics.geometry == 1 else curved(grid, None)


def evenly(ends: tuple[float, ...], size: float) -> np.ndarray:
    """Coordinates from the first end to the last, FEWEST or more to a part, not further apart than a size."""
    parts = [np.linspace(low, high, 1 + max(FEWEST, int(np.ceil((high - low) / size))))
             for low, high in zip(ends, ends[1:])]
    return np.unique(np.concatenate(parts))


#: From this A / W^2 on, thicknesses of a quarter of W: what less of an aggregate adds is, in the scheme of 2001, under
#: the error of the empty channel.
LEAST = 0.1
INCORPORATED, BOUND = "can be incorporated", "one: the bound of the law, made of other runs and drawn shapes"


@claim("C44", "5", "the model of a pore can be incorporated into a network model", **ABOUT_WIDE)
def for_networks() -> Finding:
    """Added resistance of the aggregates of base and wide, which the law for networks has not seen, against it."""
    film, spanned = (beyond(WIDE, kind) for kind in (False, True))
    checks = tuple(at_most(f"{name}: largest ln(r / law's r) over that of the law's bound", INCORPORATED,
                           np.abs(values).max(), 1.0, BOUND)
                   for name, values in (("base", beyond(BASE, False)), ("wide before contact", film),
                                        ("wide after contact", spanned)))
    note = ("r is the length of empty pore, over W, that resists as much as the aggregate adds; all that a network "
            "must know of the pore is A / W^2, lambda and whether it is spanned: `repro.added_resistance`.")
    return Finding(checks, note=note, reason="the aggregate of these runs is not one of the shapes that the law knows")


def beyond(run: tuple[str, ...], spanned: bool) -> np.ndarray:
    """(n,) ln(r / law's r) of a run's rows in the law's range from LEAST on, over the ln of its bound on that side."""
    scene, rows = load_packaged(*run), series(*run)
    width = scene.pore.width
    low, high = known(spanned)
    share = rows["aggregate_area_um2"] / width**2
    in_range = (rows["contact"] == spanned) & (share >= max(low, LEAST)) & (share <= high)
    resisted = 24e-6 * clean(scene) / rows["conductivity_m_per_d"][in_range] - 1
    law, least, most = np.log(added_resistance(share[in_range], 1.0, spanned, scene.flow.viscosity_ratio))
    apart = np.log(resisted * scene.pore.length / width) - law
    return apart / np.where(apart < 0, law - least, most - law)
