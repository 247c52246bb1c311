"""C10-C12: where the aggregate grows, in `base` while it is fully penetrated and in `wide` once it spans the pore.

C29, C31: the shapes of base and wide.

C30, C32, C33: substrates and stresses in the aggregate, over base and wide.
"""

from dataclasses import replace

import numpy as np

from repro.fem import elements
from repro.fem.mesh import Mesh
from repro.fem.walls import BOTTOM, FREE, TOP
from repro.model import biomass
from repro.model.kinetics import rate_law
from verification import sensitivity
from verification.claims import FEW, FEW_WORDS, Finding, at_least, at_most, between, claim, without_limit
from verification.claims.levels import ABOUT_WIDE, COMPARED
from verification.claims.rheology import STRESS_FREE, conductivity_change
from verification.claims.runs import (
    BASE,
    END,
    PLOTTED,
    SUBSTRATES,
    WIDE,
    WIDE_TO_END,
    Body,
    Run,
    bodies,
    body,
    contact_time,
    equivalent,
    grown,
    in_plane,
    load_packaged,
    polygon,
    series,
    stress,
    uncovered,
    upstream_part,
)
from verification.problems.runs import contact_length
from verification.uncertainty import Bar

LAST_HOURS = 5.0
#: The state of Plate 1.
BEFORE = "before the expansion"


def growth_rates(aggregate: Body) -> np.ndarray:
    """(N,) (F3 + F4) / X_m, 1/h, the rate of new biomass at the nodes of the mesh; zero in the fluid."""
    space, problem = aggregate.pore.space, aggregate.solved.problem
    rates = biomass.rates(space, aggregate.solved.concentrations, problem.law)
    density = aggregate.pore.active / space.reaction.dx / problem.law.constants.maximum_density
    return space.integration.to_nodes(density * rates.total)


@claim("C10", "4, Plate 1", "fastest growth on the upgradient side, slowest on the wall between centre and "
       "downgradient side")
def extremes() -> Finding:
    """Places of the largest and the smallest growth rate over the aggregate's nodes; x = 0 is the seed's centre."""
    aggregate = Body(load_packaged(*BASE), *grown(BASE, PLOTTED))
    rate, grid = growth_rates(aggregate), aggregate.grid
    nodes, last = grid.body, aggregate.outline.downstream
    fast, slow = nodes[np.argmax(rate[nodes])], nodes[np.argmin(rate[nodes])]
    (x_fast, _), (x_slow, y_slow) = grid.points[fast], grid.points[slow]
    checks = (at_most("x of the fastest growth (um)", "upgradient side", x_fast, 0.0, "the words"),
              between("x of the slowest growth (um)", "centre to downgradient side", x_slow, 0.0, last, "the words"),
              between("y of the slowest growth (um)", "on the wall", y_slow, 0.0, 0.0, "the words"))
    note = "An extreme lies at a node: its bar is the range over the sizes plus the distance to the next node."
    widths = (nearby(grid, fast), nearby(grid, slow), 0.0)
    checks = tuple(replace(without_limit(check), bar=Bar(check.value - width, check.value + width))
                   for check, width in zip(checks, widths))
    return Finding(checks, note=note)


def nearby(grid: Mesh, node: int) -> float:
    """Distance (um) from a node to the farthest node that shares a triangle with it. The extreme lies within this
    distance."""
    neighbours = grid.cells[(grid.cells == node).any(axis=1)].ravel()
    return float(np.hypot(*(grid.points[neighbours] - grid.points[node]).T).max())


@claim("C11", "4, Plate 2", "asymmetry minor while fully penetrated: a few percent", date="2026-11-29 23:14")
def asymmetry() -> Finding:
    """Upstream against downstream half, in percent: extents and growth rates before the expansion, the state of Plate 1
    [E12], and the expansion since t = 0 at 19.4 h, that of Plate 2. The numbers were nearly known: the extents were
    those of 19.4 h before, 0.72 %, and the other definitions are the same."""
    before, after = Body(load_packaged(*BASE), *grown(BASE, PLOTTED)), body(BASE, END)
    rate, outline = growth_rates(before), before.outline
    unexpanded = after.pore.body.solid.at.dx.sum(axis=1)
    compared = {f"extent {BEFORE}": (-outline.upstream, outline.downstream),
                f"growth rate {BEFORE}": biomass_rates(before) / halves(before, before.areas),
                "expansion since t = 0 at 19.4 h": halves(after, after.areas) / halves(after, unexpanded)}
    checks = tuple(at_most(f"{name}, upstream over downstream half (%)", "a few", 100 * abs(up / down - 1), 100 * FEW,
                           FEW_WORDS) for name, (up, down) in compared.items())
    fastest, slowest = (f(rate[before.grid.body]) for f in (max, min))
    checks += (at_most(f"point by point {BEFORE}, fastest over slowest growth (%)", "minor",
                       100 * (fastest / slowest - 1), 10, "a tenth"),)
    acceptor, donor = (least_of(before, before.concentration(name)) for name in SUBSTRATES)
    return Finding(checks, note=f"The smallest concentrations {BEFORE} are {acceptor:.2f} K_sA and {donor:.2f} K_sD.",
                   reason="growth differs by more than a tenth")


def halves(aggregate: Body, values: np.ndarray) -> np.ndarray:
    """(2,) sums of values (t,) of biomass triangles upstream and downstream of the centre of the seed."""
    x = aggregate.grid.points[aggregate.corners].mean(axis=1)[:, 0]
    return np.array([values[side].sum() for side in (x < 0, x > 0)])


def biomass_rates(aggregate: Body) -> np.ndarray:
    """(2,) integrals of the growth rate over both sides, um2/h."""
    return halves(aggregate, aggregate.areas * growth_rates(aggregate)[aggregate.corners].mean(axis=1))


@claim("C12", "4, Fig 6", "after the pore is spanned, growth is strongly asymmetric, on the upgradient side only",
       **ABOUT_WIDE)
def upgradient_only() -> Finding:
    """Share of the new area, and of the biomass made, upgradient of the seed's centre, at the end of `wide`."""
    last, end = bodies(WIDE)[-1], float(bodies(WIDE)[-1].pore.time)
    contact = contact_time(*WIDE)
    spanned = next(aggregate for aggregate in bodies(WIDE) if aggregate.pore.time >= contact)
    late, since = (upstream_part(polygon(first.outline), polygon(last.outline))
                   for first in (body(WIDE, end - LAST_HOURS), spanned))
    up, down = biomass_rates(last)
    bound = "95 %, set beforehand"
    checks = (at_least("new area upgradient, last 5 h (%)", "only upgradient", 100 * late, 95, bound),
              at_least(f"biomass made upgradient, rate at {end:g} h (%)", "only upgradient", 100 * up / (up + down), 95,
                       bound))
    note = (f"The aggregate touches the opposite wall at {contact:.2f} h. Of the new area between "
            f"{spanned.pore.time:g} h and {end:g} h, {100 * since:.1f} % lies upgradient.")
    return Finding(checks, dependence=sensitivity.on_supplies("C12"), note=note,
                   reason="growth is not only upgradient")


@claim("C29", "Fig 6", "the aggregate is squeezed between the walls as it grows",
       **ABOUT_WIDE)
def squeezed() -> Finding:
    """Outlines of wide: inside the channel; length over thickness; lengths of both contact surfaces.

    A contact surface grows by entire edges of the outline, so its least growth in an update has no limit.
    """
    rows, width = series(*WIDE), load_packaged(*WIDE).pore.width
    outlines, after = [aggregate.outline for aggregate in bodies(WIDE)], rows["contact"] == 1
    heights = np.concatenate([o.points[:, 1] for o in outlines])
    beyond = max(0.0 - heights.min(), heights.max() - width)
    slender = np.array([(o.downstream - o.upstream) / o.thickness for o in outlines])
    surfaces = np.array([(contact_length(o, BOTTOM), contact_length(o, TOP)) for o in outlines])
    rates = np.diff(surfaces[after], axis=0) / np.diff(rows["time_h"][after])[:, None]
    checks = (at_most("how far an outline leaves the channel (um)", "between the walls", beyond, 1e-9, "none"),
              at_most("largest length over thickness before contact", "half-disc: 2", slender[~after].max(),
                      2 * (1 + FEW), "a few percent"),
              at_least("the same at the end", "squeezed", slender[-1], 3, "half as much again as a half-disc's 2"),
              at_least("thickness of a free half-disc of the last area, over W", "squeezed",
                       np.sqrt(2 * outlines[-1].area / np.pi) / width, 1 + FEW, "more than fits, by a few percent"),
              without_limit(at_least("least rate at which a contact surface grows (um/h)", "as it grows", rates.min(),
                                     0.0, "both grow in each update")))
    return Finding(checks, dependence=sensitivity.on_supplies("C29"), reason="it does not hold on every mesh")


@claim("C31", "2.3.3, 4", "the shape stays a half-disc until it is limited or squeezed",
       **ABOUT_WIDE)
def stays_half_disc() -> Finding:
    """Largest deviation of the interface from a half-disc of the same area around the middle of its base."""
    base, wide = (100 * np.array([*map(deviation, bodies(run))]) for run in (BASE, WIDE))
    rows, few = series(*WIDE), 100 * FEW
    before = rows["contact"] == 0
    checks = (*(at_most(f"{name}: largest deviation (% of R)", "half-disc", deviations.max(), few, "a few percent")
                for name, deviations in (("base", base), ("wide before contact", wide[before]))),
              at_least("wide at its end: deviation (% of R)", "until squeezed", wide[-1], few,
                       "more than a few percent"))
    half = load_packaged(*WIDE).substrates.acceptor.half_saturation
    limited = rows["time_h"][rows["acceptor_min_mg_per_L"] < half]
    centre = 0.5 * (rows["upstream_um"] + rows["downstream_um"])
    return Finding(checks, note=f"In wide C_A first falls below K_s at {min(limited, default=np.inf):g} h. Growth is "
                   "then limited, but the half-disc keeps its shape and shifts: its centre is "
                   f"{-centre[before][-1]:.1f} um upstream at {rows['time_h'][before][-1]:g} h.",
                   reason="these meshes do not decide the deviation")


def deviation(aggregate: Body) -> float:
    """Largest | r / R - 1 | over the free nodes, r from the lower contact surface's middle, R = (2 area / pi)^(1/2)."""
    outline = aggregate.outline
    low = outline.points[outline.wall == BOTTOM, 0]
    free = outline.points[outline.wall == FREE] - [0.5 * (low.min() + low.max()), 0.0]
    return float(np.abs(np.hypot(*free.T) / np.sqrt(2 * outline.area / np.pi) - 1).max())


#: Number of parts of a triangle's edge. A field is evaluated at their ends in the search for its least value.
PARTS = 16


def least(run: Run, name: str) -> np.ndarray:
    """(rows,) smallest concentration of a substrate in the aggregate over K_s, also between nodes, because the node
    nearest to the minimum depends on the mesh."""
    half = getattr(load_packaged(*run).substrates, name).half_saturation
    minima = [least_of(aggregate, getattr(aggregate.solved.concentrations, name)) for aggregate in bodies(run)]
    return np.array(minima) / half


def least_of(aggregate: Body, field: np.ndarray) -> float:
    """Least value in the aggregate of the functions of a field's elements."""
    corner = np.stack(np.meshgrid(np.arange(PARTS + 1), np.arange(PARTS + 1)), axis=-1).reshape(-1, 2)
    places = corner[corner.sum(axis=1) <= PARTS] / PARTS
    space = aggregate.pore.space
    return float((field[space.cells[aggregate.grid.biomass]] @ elements.values(space.order, places).T).min())


@claim("C30", "2.2", "oxygen is always present, so that the model without anaerobic decay describes decay sufficiently "
       "well", **ABOUT_WIDE)
def oxygen() -> Finding:
    """Smallest C_A in the aggregate over K_s, in every row of base and wide, and the biomass that both would lose
    besides if decay had the full aerobic rate b at any concentration of oxygen, over the biomass at the end. The latter
    is the most that (9) may leave out, because the paper's anaerobic decay is slower.

    The rate of decay in (9)-(10) is proportional to m_A = C_A / (C_A + K_s). Oxygen counts as present if m_A >= 1/2,
    that is C_A >= K_s. Decay then has at least half of its rate with plenty of oxygen.
    """
    base, wide = (least(run, "acceptor") for run in (BASE, WIDE))
    why = "m_A >= 1/2: decay at half its rate, at least"
    checks = (at_least("base: smallest C_A / K_s", "present", base.min(), 1.0, why),
              at_least("wide: smallest C_A / K_s", "present", wide.min(), 1.0, why),
              at_least("the smaller of both", "present", min(base.min(), wide.min()), np.finfo(float).tiny, "not zero"),
              *(at_most(f"{run[0]}: biomass that decay at its full rate would take besides (% of the biomass)",
                        "sufficiently well", 100 * missing_decay(run), 100 * FEW, FEW_WORDS) for run in (BASE, WIDE)))
    hours, last = series(*WIDE)["time_h"], bodies(WIDE)[-1]
    since = hours[wide < 1][0] if (wide < 1).any() else np.inf
    reason = ("it holds in base. In wide, whose supply of 10 K_s is assumed, the front consumes all the oxygen: behind "
              f"it C_A falls below K_s at {since:g} h, and to {wide.min():.1g} K_s at {hours[wide.argmin()]:g} h. This "
              f"is not zero, but {share_under(last, 1.0):.0f} % of the biomass has less than K_s, and "
              f"{share_under(last, 0.1):.0f} % has less than K_s / 10 and hardly decays")
    return Finding(checks, reason=reason)


def missing_decay(run: Run) -> float:
    """f_d b int (1 - m_A) X_A dV dt over the biomass at the end of a run, by the trapezoidal rule between its rows."""
    rates = np.array([_missing_decay_rate(aggregate) for aggregate in bodies(run)])
    last = bodies(run)[-1].pore
    return float(np.trapezoid(rates, series(*run)["time_h"]) / (last.active.sum() + last.inert.sum()))


def _missing_decay_rate(aggregate: Body) -> float:
    """f_d b int (1 - m_A) X_A dV, um2 mg/L/h."""
    pore, constants = aggregate.pore, aggregate.solved.problem.law.constants
    remains = biomass.rates(pore.space, aggregate.solved.concentrations, aggregate.solved.problem.law).remains
    decayed = remains / (1 - constants.degradable_fraction)
    return constants.degradable_fraction * float((pore.active * (constants.decay_coefficient - decayed)).sum())


def share_under(aggregate: Body, bound: float) -> float:
    """Percentage of the active biomass at nodes with C_A under a bound (mg/L)."""
    pieces, acceptor = aggregate.pore.space.reaction, aggregate.solved.concentrations.acceptor
    under = acceptor[pieces.cells] @ pieces.values.T < bound
    return 100 * float(aggregate.pore.active[under].sum() / aggregate.pore.active.sum())


@claim("C33", "4", "Base is fully penetrated, C >> K_s", date="2026-11-24 12:50",
       unjudged="the paper states it as a condition (\"as long as the aggregate is fully penetrated\") and gives no "
                "number for C >> K_s; what follows from the condition is judged in C11 and C15")
def penetrated() -> Finding:
    """Slowest over fastest uptake in the aggregate of base at 19.2 h, and smallest C / K_s until then."""
    until = series(*BASE)["time_h"] <= PLOTTED + 1e-6
    lowest = {name: least(BASE, name)[until].min() for name in SUBSTRATES}
    least_part = 100 * evenness(body(BASE, PLOTTED))
    return Finding((), note=f"At 19.2 h the slowest uptake in the aggregate is {least_part:.0f} % of the fastest; the "
                   f"smallest concentrations until then are {lowest['acceptor']:.2g} K_s of acceptor and "
                   f"{lowest['donor']:.2g} K_s of donor.")


def evenness(aggregate: Body) -> float:
    """Smallest over largest m_A m_D in the aggregate."""
    law = rate_law(aggregate.scene.substrates, aggregate.scene.kinetics)
    m_a, m_d = law.fractions(aggregate.concentration("acceptor"), aggregate.concentration("donor"))
    rate = (m_a * m_d)[aggregate.grid.body]
    return float(rate.min() / rate.max())


@claim("C32", "5", "minor deformation stresses, so that how new biomass is born hardly matters", fine=COMPARED,
       beside=())
def stresses() -> Finding:
    """Largest stresses over mu_L in every row of base and wide; both with stress-free new biomass.

    The in-plane shear stress, and the equivalent (von Mises) stress of the whole deviator. "Minor" is the stress of a
    strain of a few percent. Outlines are compared by the area that only one of the two covers. After contact both are
    means over the rows. A contact surface grows by entire edges, so single rows jump, at other times in each run.
    """
    minor, why = 2 * FEW, f"minor: twice the modulus times a strain of {100 * FEW:g} %"
    largest_stresses = {run[0]: peaks(run) for run in (BASE, WIDE_TO_END)}
    kinds = ("in-plane shear stress / mu_L", "equivalent stress / mu_L",
             "in-plane shear stress / (mu_L theta^(-2/3))")
    checks = [at_most(f"{name}: {kind}", "minor", value, minor, why) for name, triple in largest_stresses.items()
              for kind, value in zip(kinds, triple)]
    compared = ((BASE, (PLOTTED,), f"{PLOTTED:g} h"), (WIDE_TO_END, after_contact(), "mean after contact"))
    for run, times, when in compared:
        label = f"{run[0]}, {when}, born stress-free"
        checks += [at_most(f"{label}: outlines apart (% of the area)", "not affected",
                           float(np.mean([outline_difference(run, time) for time in times])), 100 * FEW, FEW_WORDS),
                   between(f"{label}: change of the conductivity (%)", "not affected",
                           conductivity_change((*run, STRESS_FREE), times, run), -100 * FEW, 100 * FEW, FEW_WORDS)]
    uniform = 2.5 ** (-5 / 3) * (2.5 - 1)
    reason = ("it depends on the modulus. In the plane the stress is minor against mu_L, the modulus at t = 0, and in "
              f"base also against that of the grown material, mu_L theta^(-2/3); in wide it reaches "
              f"{largest_stresses['wide'][2]:.2g} of the latter after contact. "
              "Across the plane it is minor against neither: plane strain prevents expansion in this direction, and "
              "this alone gives uniform growth an equivalent stress of theta^(-5/3) "
              f"(theta - 1), at most {uniform:.3f}, for theta = 2.5. This stress does no work on the shape, and the "
              "paper's conclusions from minor stresses hold")
    return Finding(tuple(checks), reason=reason)


def peaks(run: Run) -> tuple[float, float, float]:
    """Largest in-plane shear and equivalent stress over mu_L, and largest in-plane shear stress over mu_L J^(-2/3), in
    all rows of a run."""
    triples = []
    for aggregate in bodies(run):
        cauchy = stress(aggregate)
        shear = in_plane(cauchy)
        softened = shear * aggregate.mean(aggregate.strained.J) ** (2 / 3)
        triples.append((shear.max(), equivalent(cauchy).max(), softened.max()))
    return tuple(map(float, np.max(triples, axis=0)))


def outline_difference(run: Run, time: float) -> float:
    """Area that only one of the outlines covers, with new biomass stressed and stress-free, in percent of the area."""
    return uncovered(*(polygon(body((*run, *change), time).outline) for change in ((), (STRESS_FREE,))))


def after_contact() -> tuple[float, ...]:
    """Times (h) of the rows of wide in which the aggregate touches the opposite wall with both rheologies."""
    rows, free = series(*WIDE_TO_END), series(*WIDE_TO_END, STRESS_FREE)
    return tuple(map(float, rows["time_h"][(rows["contact"] == 1) & (free["contact"] == 1)]))
