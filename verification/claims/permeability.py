"""C16, C17: the effect of the aggregate on the conductivity.

C43: base under its constant head, carried on through contact with the opposite wall to a hundredth of its velocity.

The paper's run of base ends at 19.4 h. Three statements are judged here under a constant head instead of a constant
velocity: clogging restricts the supply, an aggregate that spans the pore grows at certain places, and the conductivity
then falls sharply.
"""

from dataclasses import replace

import numpy as np

from reference import layered_channel
from repro.fem.mesher import generate_around
from repro.model import biomass
from repro.model.meshing import sized
from repro.scene import Scene
from verification.claims import CLOSED, Finding, PaperCheck, at_least, at_most, claim, near
from verification.claims.growth_pattern import biomass_rates
from verification.claims.levels import ABOUT_WIDE, BESIDE_PAIRS, PAIRED
from verification.claims.runs import (
    WIDE,
    Body,
    Columns,
    Run,
    approach,
    around_contact,
    bodies,
    contact_time,
    flow_in,
    load_packaged,
    rows_at,
    series,
)


def clean(scene) -> float:
    """Conductivity of a scene's pore without aggregate, g W^2 / (12 nu), um/h."""
    return scene.flow.gravity * scene.pore.width**2 / (12 * scene.flow.kinematic_viscosity)


def clean_per_day(scene) -> float:
    """:func:`clean` in m/day."""
    return 24e-6 * clean(scene)


def layered_share(ratio: float, part: float, walls: int) -> float:
    """K / K_clean of a channel of which layers fill a part: Poiseuille's gradient over that of parallel flow at the
    same mean velocity."""
    if walls == 1:
        return float(12.0 / layered_channel.gradient(1.0, part, ratio))
    open_ = 1.0 - part
    return open_**3 + (1.0 - open_**3) / ratio


#: Part of its biomass that the aggregate gains up to contact in the windows of a slope and of a fall; and in that of a
#: slope while a film is left.
GAINED, QUARTER, SMALL = 0.1, 0.25, 0.02
#: "Sharply": this many times as steeply as under uniform layers of the same biomass.
TWICE_AS_STEEP, SHARPLY = 2.0, "falls sharply"
#: The slope with which a quarter more biomass leaves a tenth of the conductivity.
TENFOLD = float(np.log(10) / np.log(1 + QUARTER))
ORDER = "an order of magnitude"
#: Words and origin of the bound of a slope.
AS_TENFOLD = "the mean slope with which a quarter more biomass leaves a tenth of the conductivity"


@claim("C16", "4, 2.1", "conductivity falls sharply when the aggregate spans the pore (at constant velocity; C43 has "
       "the numbers at constant head)", date="2026-11-29 23:11", **ABOUT_WIDE)
def spanning() -> Finding:
    """Conductivity of `wide` against its biomass up to contact. At contact it is that of the first shape in which a
    film has closed. A film closes by entire edges of the outline, so the error is of first order in their length:
    several percent."""
    film, closed = (around_contact(*WIDE)["conductivity_m_per_d"] / clean_per_day(load_packaged(*WIDE))).tolist()
    checks = (at_most("K / K_clean at contact", SHARPLY, closed, 0.01, "orders of magnitude: two at least"),
              *slopes(WIDE, "wide"),
              at_least("fall as the last film closes (times)", "when the aggregate spans the pore", film / closed, 10.0,
                       ORDER))
    before = 100 * np.log(film) / np.log(closed)
    change = (f"it falls while the aggregate approaches the opposite wall, not at contact: {before:.0f} % of the "
              f"orders of magnitude lost up to contact are lost while a film is left. K / K_clean is {film:.2g} in the "
              f"last shape with a film and {closed:.2g} in the first one without, {film / closed:.1f} times less")
    return Finding(checks, change=change, reason="most of the fall precedes contact", note=_in_long_pores(WIDE))


def slopes(run: Run, name: str) -> tuple[PaperCheck, ...]:
    """How steeply the conductivity of a run falls up to contact, from the rows of `approach`: -d ln K / d ln A over
    GAINED; the fall over QUARTER; the steepest slope over SMALL while a film is left; and the first over that of a
    uniform layer of the same biomass. The last depends on the length of the pore, since the layer does."""
    scene = load_packaged(*run)
    slope, lengths = steepness(run), scene.pore.length / scene.pore.width
    return (at_least(f"slope of {name}: -d ln K / d ln A over the last {100 * GAINED:g} % of biomass up to contact",
                     SHARPLY, slope, TENFOLD, AS_TENFOLD),
            at_least(f"fall of {name} over the last quarter more biomass up to contact (times)", SHARPLY,
                     fall_of(run, QUARTER), 10.0, ORDER),
            at_least(f"steepest slope of {name} while a film is left: -d ln K / d ln A over {100 * SMALL:g} % of "
                     "biomass", SHARPLY, steepest_with_film(run), TENFOLD, AS_TENFOLD),
            at_least(f"{name}: -d ln K / d ln A over that of a uniform layer, in a pore of {lengths:g} W", SHARPLY,
                     slope / layer_slope(run, lengths), TWICE_AS_STEEP, "twice as steep at least"))


def layer_slope(run: Run, lengths: float) -> float:
    """-d ln K / d ln A of a uniform layer on one wall with the biomass of a run at contact, in a pore of a length over
    its width, over the same window."""
    scene = load_packaged(*run)
    part = float(around_contact(*run)["aggregate_area_um2"][1]) / (scene.pore.width**2 * lengths)
    ratio = scene.flow.viscosity_ratio
    return np.log(layered_share(ratio, part / (1 + GAINED), 1) / layered_share(ratio, part, 1)) / np.log(1 + GAINED)


#: Lengths of pores over their width: Table 1's 600 um over 100 and 50 um, and twice as long.
LENGTHS = (6.0, 12.0, 24.0)


def at_length(share: float, scene: Scene, lengths: float) -> float:
    """K / K_clean of a pore of a length over its width, from that in the scene's pore: the aggregate adds the same
    resistance."""
    return 1 / (1 + (1 / share - 1) * scene.pore.length / scene.pore.width / lengths)


def _in_long_pores(run: Run) -> str:
    """Describe how the fall depends on the length of the pore."""
    scene = load_packaged(*run)
    closed = float(around_contact(*run)["conductivity_m_per_d"][1]) / clean_per_day(scene)
    rows = ", ".join(f"{at_length(closed, scene, lengths):.2g} and {steepness(run, lengths):.3g} against "
                     f"{layer_slope(run, lengths):.3g} at {lengths:g} W" for lengths in LENGTHS)
    return f"K / K_clean at contact, and the slope against that of a uniform layer, in pores of other lengths: {rows}."


def steepness(run: Run, lengths: float | None = None) -> float:
    """-d ln K / d ln A of a run over the last part GAINED of its biomass up to contact, the closing film included;
    lengths: of the pore over its width, by default the run's own."""
    return float(np.log(fall_of(run, GAINED, lengths)) / np.log(1 + GAINED))


def fall_of(run: Run, gained: float, lengths: float | None = None) -> float:
    """K with 1 / (1 + gained) of the biomass at contact over K just after contact; lengths: of the pore over its width,
    by default the run's own."""
    area, share = map(np.log, _approach(run, lengths))
    return float(np.exp(np.interp(area[-1] - np.log(1 + gained), area[:-1], share[:-1]) - share[-1]))


def steepest_with_film(run: Run) -> float:
    """Largest -d ln K / d ln A over a part SMALL of the biomass while a film is left."""
    area, share = (np.log(values[:-1]) for values in _approach(run))
    ends = area[area >= area[0] + np.log(1 + SMALL)]
    falls = np.interp(ends - np.log(1 + SMALL), area, share) - np.interp(ends, area, share)
    return float(falls.max() / np.log(1 + SMALL))


def _approach(run: Run, lengths: float | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Areas (um2) and conductivities of the rows of `approach`, those over K_clean in a pore of another length."""
    area, share = (approach(*run)[key] for key in ("aggregate_area_um2", "conductivity_m_per_d"))
    if lengths is not None:
        scene = load_packaged(*run)
        share = at_length(share / clean_per_day(scene), scene, lengths)
    return area, share


@claim("C17", "2.1", "lambda = 2000 allows a permeability reduction of up to 2000 (pore filled over its length)",
       about=CLOSED)
def filled() -> Finding:
    """Conductivity of the clean pore over that of the pore filled with biomass, on the default mesh of the entire
    pore."""
    scene = load_packaged("flow_only")
    half = scene.pore.length / 2
    empty, _ = generate_around([], (-half, half), sized(scene))
    full = replace(empty, topology=replace(empty.topology, region=1 - empty.topology.region))
    open_, closed = (flow_in(scene, grid).conductivity for grid in (empty, full))
    check = near("reduction of the conductivity (times)", "up to 2000", open_ / closed, scene.flow.viscosity_ratio,
                 0.001 * scene.flow.viscosity_ratio,
                 "exact in the Laplacian form: the problems differ by the factor lambda alone")
    return Finding((check,))


END = 76
#: Base carried on through contact, with rows to END; its run ends later, so that its last rows are of one step.
CLOSING = ("base", f'growth.end="{END + 2} h"', rows_at(*range(2, 72), *np.arange(72.0, END, 0.5), END))


@claim("C43", "1, 4", "as biomass grows, permeability falls, which restricts flow and supply: under constant head",
       fine=PAIRED, beside=BESIDE_PAIRS, date="2026-11-30 10:45")
def throttled() -> Finding:
    """Base to 76 h: flow, uptake and growth at the end over their first or largest values; decay of active biomass over
    its synthesis. The fall of the conductivity with the biomass up to contact is a number without a verdict here: C16
    judges "sharply"."""
    rows, last = series(*CLOSING), bodies(CLOSING)[-1]
    velocity, uptake = rows["mean_velocity_m_per_d"], consumed(rows)
    film, closed = around_contact(*CLOSING)["mean_velocity_m_per_d"]
    touched, rate = contact_time(*CLOSING), specific_growth(rows)
    tenth = float(np.interp(-0.1, -velocity / velocity[0], rows["time_h"]))
    words = "restricts"
    checks = (
        at_most("velocity just after contact over that at t = 0", words, closed / velocity[0], 0.1, ORDER),
        at_most(f"acceptor taken up at {END} h over the most ever", words, uptake[-1] / uptake.max(), 0.1, ORDER),
        at_most(f"growth rate of the area, last hours to {END} h over the first 2 h", words, rate[-1] / rate[0], 0.1,
                ORDER),
        at_most(f"decay over synthesis of active biomass at {END} h", "restricts, and does not end it",
                decay_share(last), 1.0, "the active biomass still increases"),
        *slopes(CLOSING, "base"))
    reason = ("flow and supply are restricted long before the pore is spanned: a tenth of the velocity is left at "
              f"{tenth:.1f} h, and from then on the aggregate starves. The last film closes only at {touched:.1f} h, "
              f"and with it the conductivity falls by a factor of {film / closed:.2g}. Decay "
              "never balances synthesis, because both are proportional to m_A in (9): where the acceptor is used up, "
              "both stop")
    decays = ", ".join(f"{decay_share(aggregate):.2g} at {aggregate.pore.time:g} h"
                       for aggregate in bodies(CLOSING)[::12])
    return Finding(checks, reason=reason, note=f"Decay over synthesis is {decays}. {_in_long_pores(CLOSING)}")


@claim("C54", "4", "once the pore is spanned, growth is strongly asymmetric, most of it on the upgradient side",
       fine=PAIRED, beside=BESIDE_PAIRS, date="2026-11-29 16:48")
def mostly_upgradient() -> Finding:
    """Shares of the biomass made upgradient of the seed's centre: base at 76 h, under constant head, and wide at 45 h,
    at constant velocity. Section 4 says "most of it"; "only" is Figure 6's word (C12)."""
    checks = []
    for name, last in ((f"base, {END} h", bodies(CLOSING)[-1]), ("wide", bodies(WIDE)[-1])):
        up, down = biomass_rates(last)
        checks += [at_least(f"{name}: biomass made upgradient, rate (%)", "most of it", 100 * up / (up + down), 50,
                            "the greater part"),
                   at_least(f"{name}: upgradient over downgradient rate", "strongly asymmetric", up / down, 2,
                            "twice as much")]
    return Finding(tuple(checks), reason="growth is not mostly upgradient")


def consumed(rows: Columns) -> np.ndarray:
    """(n,) acceptor taken up per time and width of the pore, m/d mg/L: u_ave (10 mg/L - C_effluent)."""
    return rows["mean_velocity_m_per_d"] * (10.0 - rows["effluent_acceptor_mg_per_L"])


def specific_growth(rows: Columns) -> np.ndarray:
    """(n - 1,) mean growth rate (1/h) of the aggregate's area between rows."""
    return np.diff(np.log(rows["aggregate_area_um2"])) / np.diff(rows["time_h"])


def decay_share(aggregate: Body) -> float:
    """Decay over synthesis of active biomass, both terms of (9) over the whole aggregate."""
    pore, solved = aggregate.pore, aggregate.solved
    law = solved.problem.law
    rates = biomass.rates(pore.space, solved.concentrations, law)
    decay = float((pore.active * rates.remains).sum()) / (1 - law.constants.degradable_fraction)
    return decay / (float((pore.active * rates.growth).sum()) + decay)
