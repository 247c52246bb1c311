"""C38, C39: what the paper says in its introduction and discussion, and does not compute."""

from __future__ import annotations

from math import gamma

import numpy as np

from reference import layered_channel
from verification.claims import Finding, at_least, claim
from verification.claims.accuracy import FEW, FEW_WORDS
from verification.claims.levels import WIDE_FINE
from verification.claims.permeability import clean
from verification.claims.restored import Body, bodies, interface_length
from verification.claims.runs import BASE, WIDE, scene, series

#: Conductivities over the clean channel's at which the biomass is compared.
REDUCED = (0.5, 0.1, 0.01)
#: The one at which the conductivities of equal biomass are compared.
SAME = 0.1
#: Thicknesses of a layer over the width that is left to it.
LAYERS = np.linspace(1e-4, 1.0, 4001)
NEW = "2026-11-22"


@claim("C38", "1", "it takes less biomass to plug a pore if it forms aggregates than if it forms a continuous biofilm",
       fine=WIDE_FINE)
def less_biomass() -> Finding:
    """Biomass of a uniform layer on the lower wall, and of two layers on both, over that of the growing aggregate of
    wide, at equal conductivity of the 600 um pore: parallel flow in closed form."""
    said = scene(*WIDE)
    checks, told = [], []
    for reduced in REDUCED:
        ours = filled_at(reduced)
        layers = [filled(said.flow.viscosity_ratio, reduced, walls) for walls in (1, 2)]
        checks += [at_least(f"K / K_clean = {reduced:g}: biomass of layers on {walls} wall{'s' * (walls - 1)} over the "
                            "aggregate's", "less", layer / ours, 1.0, "the words", date=NEW)
                   for walls, layer in zip((1, 2), layers)]
        told.append(f"{reduced:g}: {100 * ours:.1f} % against {100 * layers[0]:.0f} and {100 * layers[1]:.0f} %")
    same = filled_at(SAME)
    checks += [at_least(f"the part filled with which the aggregate has K / K_clean = {SAME:g}: that of layers on "
                        f"{walls} "
                        f"wall{'s' * (walls - 1)} over it", "crucial to model permeability reduction",
                        layered_share(said.flow.viscosity_ratio, same, walls) / SAME, 1 + FEW,
                        f"porosity does not determine it: more than {FEW_WORDS}", date=NEW) for walls in (1, 2)]
    return Finding(tuple(checks), reason="a layer plugs with less, or porosity determines the permeability",
                   note=f"Share of the pore that is filled, aggregate against layers on one and on both walls, at "
                   f"K / K_clean = {'; '.join(told)}.")


def filled_at(reduced: float) -> float:
    """Share of the pore that the aggregate of wide fills when it has reduced the conductivity to a part."""
    said, rows = scene(*WIDE), series(*WIDE)
    share = rows["conductivity_m_per_d"] / (24e-6 * clean(said))
    area = np.exp(np.interp(-np.log(reduced), -np.log(share), np.log(rows["aggregate_area_um2"])))
    return float(area) / (said.pore.width * said.pore.length)


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


@claim("C39", "5", "a mass transfer coefficient cannot be set a priori: it depends on the sink in the solid")
def mass_transfer() -> Finding:
    """Sherwood numbers of base from t = 0 to 19.2 h: uptake over interface and drop of the concentration from the
    supply to the interface's mean, times thickness over diffusivity in water. Beside them a textbook's, that of a flat
    patch as long as the aggregate; and those of one shape in one flow with little and with much supply, whose sinks are
    nearly of first and of zero order."""
    early = [found for found in bodies(BASE) if found.pore.time <= 19.2 + 1e-6]
    numbers = np.array([sherwood(found) for found in early])
    names, textbook = ("acceptor", "donor"), textbooks(early[-1])
    checks = [at_least(f"{name}: largest over smallest Sherwood number, less one (%)", "cannot be set",
                       100 * change, 100 * FEW, FEW_WORDS, date=NEW)
              for name, change in zip(names, numbers.max(axis=0) / numbers.min(axis=0) - 1)]
    checks += [at_least(f"{name}, 19.2 h: Leveque's number over ours, less one, either way (%)", "cannot be set",
                        100 * abs(given / ours - 1), 100 * FEW, FEW_WORDS, date=NEW)
               for name, given, ours in zip(names, textbook, numbers[-1])]
    sinks = np.array([sherwood(in_one_shape(supply=supply, faster=faster)) for supply, faster in SINKS])
    checks += [at_least(f"{name}, one shape and flow: Sherwood numbers of three sinks, largest over smallest less one "
                        "(%)", "depends on the sink in the solid", 100 * change, 100 * FEW, FEW_WORDS, date=NEW)
               for name, change in zip(names, sinks.max(axis=0) / sinks.min(axis=0) - 1)]
    told = ", ".join(f"{a:.3g} and {d:.3g} at {found.pore.time:g} h"
                     for found, (a, d) in list(zip(early, numbers))[::6] + [(early[-1], numbers[-1])])
    shapes = "; ".join(f"{a:.3g} and {d:.3g} with supplies of {supply:g} K_s and {faster:g} k"
                       for (supply, faster), (a, d) in zip(SINKS, sinks))
    reason = ("it cannot be set a priori, since it follows shape and flow; but from a sink of first order to one at "
              "the "
              f"surface alone it moves by {100 * (sinks[:, 0].max() / sinks[:, 0].min() - 1):.1f} and "
              f"{100 * (sinks[:, 1].max() / sinks[:, 1].min() - 1):.1f} % only, acceptor and donor: most of the drop "
              "is "
              "in the water upstream, which does not see how the biomass takes up what arrives")
    return Finding(tuple(checks), reason=reason, note=f"Sherwood numbers of acceptor and donor: {told}; Leveque's at "
                                                      "19.2 h "
                   f"{textbook[0]:.3g} and {textbook[1]:.3g}. A half-disc of {RADIUS:g} um in the flow of 1e-3 cm: "
                   f"{shapes}. While it is penetrated, the sink is as even of first order as of zero order, and the "
                   "number that of shape and flow.")


#: Supplies of both (K_s) and rates over that of Table 1 of three sinks: nearly of first order, of zero order, and at
#: the surface; and the half-disc's radius (um).
SINKS, RADIUS = ((1.0, 1.0), (100.0, 1.0), (1.0, 100.0)), 25.0


def in_one_shape(radius: float = RADIUS, supply: float = 10.0, head: float = 1e-3, faster: float = 1.0) -> Body:
    """A half-disc of a radius (um) in the pore of base at rest, under a head (cm), with both supplies (mg/L) and a
    maximum rate over that of Table 1."""
    supplies = (f'substrates.{name}.supply="{supply!r} mg/L"' for name in ("acceptor", "donor"))
    return bodies(("base", 'growth.end="0 h"', f'aggregate.radius="{radius!r} um"', f'flow.head="{head!r} cm"',
                   f'kinetics.maximum_utilization_rate="{9.3 * faster!r} 1/day"', *supplies))[0]


def sherwood(found: Body) -> tuple[float, float]:
    """Of both substrates."""
    length, values = interface_length(found), []
    nodes = found.grid.loop[found.outline.interface_edges()]
    for name, flux, substrate in zip(("acceptor", "donor"), found.solved.fluxes, found.solved.problem.both):
        drop = substrate.supply - float(found.node(f"{name}_mg_per_L")[nodes].mean())
        values.append(flux.consumed / (length * drop) * found.outline.thickness / substrate.diffusivity)
    return tuple(values)


def textbooks(found: Body) -> tuple[float, float]:
    """The same of a flat patch on the wall, as long as the aggregate (Leveque), with the aggregate's thickness."""
    outline, shear = found.outline, 6 * found.solved.flow.mean_velocity / found.grid.width
    patch = outline.downstream - outline.upstream
    return tuple(leveque(shear, patch, each.diffusivity) * outline.thickness / patch
                 for each in found.solved.problem.both)


def leveque(shear: float, length: float, diffusivity: float) -> float:
    """Mean Sherwood number, by its length, of a patch on a wall with constant concentration in a shear flow, at large
    Peclet numbers: 3/2 (G l^2 / D)^(1/3) / (9^(1/3) Gamma(4/3)), that is 0.807 (G l^2 / D)^(1/3)."""
    return 1.5 * (shear * length**2 / diffusivity / 9) ** (1 / 3) / gamma(4 / 3)
