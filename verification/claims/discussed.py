"""C38-C40: what the paper says in its introduction and discussion, and does not compute."""

from __future__ import annotations

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
#: Thicknesses of a layer over the width that is left to it.
LAYERS = np.linspace(1e-4, 1.0, 4001)
NEW = "2026-11-22"


@claim("C38", "1", "it takes less biomass to plug a pore if it forms aggregates than if it forms a continuous biofilm",
       fine=WIDE_FINE)
def less_biomass() -> Finding:
    """Biomass of a uniform layer on the lower wall, and of two layers on both, over that of the growing aggregate of
    wide, at equal conductivity of the 600 um pore: parallel flow in closed form."""
    said, rows = scene(*WIDE), series(*WIDE)
    share = rows["conductivity_m_per_d"] / (24e-6 * clean(said))
    area, whole = rows["aggregate_area_um2"], said.pore.width * said.pore.length
    checks, told = [], []
    for reduced in REDUCED:
        ours = float(np.exp(np.interp(-np.log(reduced), -np.log(share), np.log(area)))) / whole
        layers = [filled(said.flow.viscosity_ratio, reduced, walls) for walls in (1, 2)]
        checks += [at_least(f"K / K_clean = {reduced:g}: biomass of layers on {walls} wall{'s' * (walls - 1)} over the "
                            "aggregate's", "less", layer / ours, 1.0, "the words", date=NEW)
                   for walls, layer in zip((1, 2), layers)]
        told.append(f"{reduced:g}: {100 * ours:.1f} % against {100 * layers[0]:.0f} and {100 * layers[1]:.0f} %")
    return Finding(tuple(checks), reason="a layer plugs with less",
                   note=f"Share of the pore that is filled, aggregate against layers on one and on both walls, at "
                   f"K / K_clean = {'; '.join(told)}.")


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
    supply to the interface's mean, times thickness over diffusivity in water."""
    early = [found for found in bodies(BASE) if found.pore.time <= 19.2 + 1e-6]
    numbers = np.array([sherwood(found) for found in early])
    checks = tuple(at_least(f"{name}: largest over smallest Sherwood number, less one (%)", "cannot be set",
                            100 * change, 100 * FEW, FEW_WORDS, date=NEW)
                   for name, change in zip(("acceptor", "donor"), numbers.max(axis=0) / numbers.min(axis=0) - 1))
    told = ", ".join(f"{a:.3g} and {d:.3g} at {found.pore.time:g} h"
                     for found, (a, d) in list(zip(early, numbers))[::6] + [(early[-1], numbers[-1])])
    return Finding(checks, reason="it stays the same to a few percent", note=f"Sherwood numbers of acceptor and donor: "
                   f"{told}.")


def sherwood(found: Body) -> tuple[float, float]:
    """Of both substrates."""
    length, values = interface_length(found), []
    nodes = found.grid.loop[found.outline.interface_edges()]
    for name, flux, substrate in zip(("acceptor", "donor"), found.solved.fluxes, found.solved.problem.both):
        drop = substrate.supply - float(found.node(f"{name}_mg_per_L")[nodes].mean())
        values.append(flux.consumed / (length * drop) * found.outline.thickness / substrate.diffusivity)
    return tuple(values)


@claim("C40", "5", "detachment by fracture along the lines of maximum stress could be incorporated", fine=WIDE_FINE)
def tearing() -> Finding:
    """Largest principal stress in the aggregate of base and wide: is there tension, and where would it tear first?"""
    peaks = {run[0]: [tension(found) for found in bodies(run)[1:]] for run in (BASE, WIDE)}
    modulus = scene(*BASE).growth.shear_modulus
    checks = [at_least(f"{name}: largest principal stress over mu_L", "stress is computed",
                       max(peaks[name])[0] / modulus, 0.0, "tension", date=NEW) for name in peaks]
    value, x, y, hours = max(peaks["wide"])
    first = max(peaks["base"])
    note = (f"In base it is {first[0] / modulus:.2g} mu_L, at ({first[1]:.1f}, {first[2]:.1f}) um and {first[3]:g} h; "
            f"in wide {value / modulus:.2g} mu_L at ({x:.0f}, {y:.0f}) um and {hours:g} h: there it would tear first.")
    return Finding(tuple(checks), reason="nothing is under tension", note=note)


def tension(found: Body) -> tuple[float, float, float, float]:
    """Largest principal stress (MPa), its place (um) and time (h)."""
    values = found.cell("largest_principal_stress_MPa")
    worst = int(values.argmax())
    x, y = found.grid.points[found.triangles[worst]].mean(axis=0)
    return float(values[worst]), float(x), float(y), found.pore.time
