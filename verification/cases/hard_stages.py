"""Hard cases of the substrates and the flow.

Substrates: starved pores, an exhausted substrate, fronts of zero order, saturated kinetics. Flow: high and vanishing
speed, viscosity ratios to 1e9, a plug on coarse meshes.
"""

from collections.abc import Iterator
from functools import partial

import numpy as np
from scipy.optimize import brentq

from reference import layered_channel, slab
from repro.model import flow, transport
from repro.model.kinetics import Sink
from repro.model.resistance import Viscous
from repro.results import M_PER_D
from verification.evidence.checks import Check, at_least, at_most, between, largest
from verification.problems import channels, hard, meshes, runs
from verification.problems.channels import NAMES
from verification.problems.hard import DRIVE, EFFLUENTS, FIXED, SHAPE, TOLERANCE, HardCase, Run


def supply(acceptor: float, donor: float) -> tuple[str, str]:
    """Supplies, mg/L."""
    return f'substrates.acceptor.supply="{acceptor} mg/L"', f'substrates.donor.supply="{donor} mg/L"'


def disc(radius: float, *changes: str) -> tuple[str, ...]:
    """A half-disc (um) that does not grow, in the wide pore."""
    return (*FIXED, f'aggregate.radius="{radius} um"', *changes)


SLOW = 'flow.mean_velocity="0.35 m/day"'


def same_root(run: Run) -> Check:
    """Check that Newton's method reaches one solution from above, from zero and from far below zero.

    Monod's law has spurious roots below zero.
    """
    solved = run.end.solved
    problem, state = solved.problem, channels.both(solved.concentrations)
    supplies = problem.supply.reshape(2, -1)
    starts = (transport.Concentrations(*(part * supplies)) for part in (0.0, 1.0, -7.6))
    solutions = [channels.both(transport.steady(problem, Sink(run.end.pore.active), start)) for start in starts]
    return at_most("largest difference of C over the supply, from four starts",
                   largest((np.array(solutions) - state) / supplies), 1e-6,
                   "uptake is monotone: one solution; Newton's tolerance, times the system's condition")


def starved(preset: str, changes: tuple[str, ...]) -> list:
    """A starved half-disc."""
    run, _, checks = hard.against("wide", preset, changes, *EFFLUENTS)
    return [checks, same_root(run)]


#: Changes of the scene, by part: starved half-discs.
HUNGRY = {"0.35 m/d, R = 27 um": disc(27, SLOW, 'pore.width="50 um"'),
          "0.35 m/d, R = 42 um": disc(42, SLOW, 'pore.width="50 um"'),
          "supply 0.15 mg/L": disc(40, *supply(0.15, 0.15)), "supply 0.02 K_s": disc(40, *supply(0.02, 0.02))}


STARVED = HardCase(
    1, "starved", "Starved pore",
    "One solution from every start, nowhere under zero, with the effluents of a finer run",
    "A negative root of the Monod terms (C_A = -76 mg/L with a closed balance was seen)",
    {name: partial(starved, changes=changes) for name, changes in HUNGRY.items()},
    mutants=("hard-newton-too-soon",))


def exhausted(preset: str, scarce: str) -> list:
    """One substrate at 10 mg/L, the other at 1000 mg/L; then that at 1e6 mg/L."""
    def run_with(plenty: float) -> Run:
        supplies = (10.0 if name == scarce else plenty for name in NAMES)
        return hard.run_packaged("wide", preset, *disc(80, SLOW), *supply(*supplies))

    run, larger_excess = run_with(1000.0), run_with(1e6)
    column = f"effluent_{scarce}_mg_per_L"
    return [run, _stoichiometry(run),
            at_most(f"least {scarce} over its supply", run.last[f"{scarce}_min_mg_per_L"] / 10, 0.02,
                    "else less is tested"),
            at_most(f"{column}: 1000 mg/L of the other for 1e6, over the supply",
                    abs(run.last[column] - larger_excess.last[column]) / 10, 2e-3,
                    "the other's m is 0.997 or more: uptake changes by less, and so do effluents")]


def _stoichiometry(run: Run) -> list[Check]:
    """Check that (7) less F times (8) is the uptake of decay, d_c f_d b X m_A, at any concentrations."""
    law, both = run.scene.kinetics, run.scene.substrates
    acceptor, donor = (flux.consumed for flux in run.end.solved.fluxes)
    demand = law.acceptor_to_donor_ratio * donor
    decay = channels.decay_demand(law) * law.maximum_density * run.last["aggregate_area_um2"]
    C = run.end.solved.concentrations.acceptor
    ends = np.array([max(C.min(), 0.0), C.max()])
    m = ends / (ends + both.acceptor.half_saturation)
    low, high = (acceptor - decay * m[::-1]) / demand
    return [between("acceptor taken up for decay, over what m_A = 1 would take", (acceptor - demand) / decay,
                    m[0] * (1 - 1e-9), m[1] * (1 + 1e-9),
                    "its mean m_A lies between those of the least and the largest C_A"),
            between("F times donor, over acceptor less decay's share", 1.0, low, high, "as above")]


EXHAUSTED = HardCase(
    2, "exhausted", "One substrate exhausted, the other in excess",
    "Uptake in the ratio of (7) and (8), and the same effluents with a thousandfold excess",
    "Uptake of an exhausted substrate, or a substrate in excess that is clipped or overshoots",
    {f"{scarce} exhausted": partial(exhausted, scarce=scarce) for scarce in NAMES},
    mutants=("hard-decay-unlimited",))


#: Half saturations of a millionth of the supply.
SHARP = tuple(f'substrates.{name}.half_saturation="1e-5 mg/L"' for name in NAMES)


def front(preset: str, radius: float, changes: tuple[str, ...] = ()) -> list:
    """A half-disc with half saturations of a millionth of the supply."""
    return hard.against("wide", preset, disc(radius, *SHARP, *changes), *EFFLUENTS, refinement=0.8)[2]


#: Half thickness and films of the slab (um), and its penetration depth over the half thickness.
HALF = 40.0
FILM = 20.0
DEPTH = 0.6


def slab_front(preset: str) -> list:
    """The stage alone: a slab between films of still water, in which the donor is used up at 0.6 of its half thickness.

    At the front C'' jumps from s / D to zero, so an element of any order errs by at most s h^2 / (8 D).
    """
    size = SIZES[preset]
    end, width = HALF + FILM, 1.5 * size
    scene = hard.load("wide", preset, *SHARP, 'kinetics.decay_coefficient="0 1/d"',
                        "kinetics.acceptor_to_donor_ratio=1e-9")
    space = meshes.space_on(meshes.plug((-end, end), width, HALF, size, seed=1), scene.numerics.scheme.order)
    donor, depth = scene.substrates.donor, DEPTH * HALF
    ratio = donor.diffusivity_in_aggregate / donor.diffusivity
    sink = donor.supply * donor.diffusivity_in_aggregate / (depth**2 / 2 + FILM * ratio * depth)
    bound, origin = size**2 / 8 / (depth**2 / 2 + FILM * depth * 0.8), FRONT
    problem = transport.problem(space, None, scene.substrates, scene.kinetics, scene.numerics.scheme)
    active = Sink(sink / scene.kinetics.maximum_utilization_rate * space.reaction.dx)
    state = transport.steady(problem, active)
    parameters = (donor.supply, sink, HALF, donor.diffusivity_in_aggregate, FILM, donor.diffusivity)
    exact = slab.zero_order(space.points[:, 0], *parameters)
    entering = transport.fluxes(problem, active, state)[1].consumed / (2 * width * sink)
    return [at_most("C_D over the supply, largest error at a node", largest(state.donor - exact) / donor.supply, bound,
                    origin),
            at_most("depth of the front, over that of the closed form", abs(entering / depth - 1), bound, origin),
            at_least("least C_D over the supply", state.donor.min() / donor.supply, hard.LOWEST, "UNRESOLVED")]


FRONT = "the jump of C'' at the front: s h^2 / (8 D_B)"
#: Element sizes, um.
SIZES = {"paper": 6.0, "fast": 12.0, "accurate": 5.0}
ZERO_ORDER = HardCase(
    3, "zero-order", "Half saturations of a millionth of the supply: fronts of zero order",
    "The closed form of zero-order uptake in a slab, and the effluents of a finer run around half-discs",
    "Newton's method that cycles at the front, or concentrations under zero behind it",
    {"slab": slab_front, "R = 60 um": partial(front, radius=60), "R = 80 um": partial(front, radius=80),
     "0.35 m/d, R = 40 um": partial(front, radius=40, changes=(SLOW,))},
    refusable=("slab",),
    mutants=("hard-front-smoothed", "hard-newton-unshortened"))


def saturated(preset: str) -> list:
    """Base with a supply of 1000 K_s: m is one to a few parts in a thousand, and growth is exponential."""
    run = hard.run_packaged("base", preset, *supply(1000, 1000), 'growth.time_step="0.5 h"',
                            'output.times=["6 h", "12 h"]', 'growth.end="12 h"')
    return [run, exponential(run)]


def exponential(run: Run) -> list[Check]:
    """Check the growth of biomass against (9)-(10) at the supply and at the least concentrations of the run."""
    time, scene = run.last["time_h"], run.scene
    lowest = (run.column(f"{name}_min_mg_per_L").min() for name in NAMES)
    least, _ = runs.growth_rates(scene.kinetics, scene.substrates, *lowest)
    return [between("area over that of the seed", run.over_first()[-1], np.exp(least * time),
                    runs.mass_after(scene, time), "rates at the least C of the run, and at the supply")]


SATURATED = HardCase(
    21, "saturated", "Supply of 1000 K_s",
    "Growth between the exponentials at the least concentration and at the supply, 0.3 % apart in their rates",
    "A balance that does not close, because uptake is a small part of the flux", {"base": saturated},
    mutants=("decay-leaves-all",))


BASE_SPEED = 2.9


def speed(factor: float) -> str:
    """A mean velocity of so many times 2.9 m/d."""
    return f'flow.mean_velocity="{BASE_SPEED * factor!r} m/day"'


def fast_flow(preset: str, factor: float) -> list:
    """A half-disc of 60 um that does not grow, at a velocity and at a tenth of it."""
    slower = hard.run_packaged("wide", preset, *disc(60, speed(factor / 10)))
    computed, fine, checks = hard.against("wide", preset, disc(60, speed(factor)), *EFFLUENTS, *DRIVE,
                                         refinement=FINER[factor])
    uptake, expected = (run.end.solved.fluxes[0].consumed for run in (computed, fine))
    return [checks, _more_than(computed, slower, preset),
            at_most("acceptor taken up, against a finer run", abs(uptake / expected - 1), 2 * TOLERANCE[preset],
                    "that of concentrations at the aggregate, area and rate: twice the preset's")]


#: Refinement of the finer run. Boundary layers need 0.23, 0.49, 1.06 and 2.3 (pore.resolution).
FINER = {1: 1.0, 10: 1.0, 100: 1.5, 1000: 2.8}


def _more_than(faster: Run, slower: Run, preset: str) -> list[Check]:
    """Check that uptake lies between that at a tenth of the velocity and that at the supply everywhere."""
    law, both = faster.scene.kinetics, faster.scene.substrates
    m_a, m_d = (s.supply / (s.supply + s.half_saturation) for s in (both.acceptor, both.donor))
    most = law.maximum_utilization_rate * m_a * m_d * law.maximum_density * faster.last["aggregate_area_um2"]
    uptake, slower_uptake = (run.end.solved.fluxes[1].consumed for run in (faster, slower))
    return [between("uptake of donor over that at the supply everywhere", uptake / most,
                    slower_uptake / most * (1 - TOLERANCE[preset]), 1.0, "it rises with the velocity: that at a tenth")]


def fast_growth(preset: str, factor: float) -> list:
    """Two hours of growth from 40 um at a high velocity."""
    changes = ('aggregate.radius="40 um"', 'growth.end="2 h"', 'output.times=["2 h"]', speed(factor))
    return hard.against("wide", preset, changes, *SHAPE, *DRIVE, refinement=FINER[factor])[2]


FAST = HardCase(
    4, "fast-flow", "Velocity times 1, 10, 100, 1000",
    "Uptake that rises with the velocity to that at the supply, and the numbers of a finer run",
    "Oscillations of C above the supply or under zero where the cell Peclet number is over one",
    {**{f"velocity x {factor}": partial(fast_flow, factor=factor) for factor in (1, 10, 100, 1000)},
     "velocity x 100, growing": partial(fast_growth, factor=100)},
    refusable=("velocity x 1000",),
    mutants=("cross-flow-sign",))


def no_flow(preset: str) -> list:
    """A velocity of zero with substrates has no steady state fed by the inlet. The scene must be refused."""
    hard.load("wide", preset, *FIXED, 'flow.mean_velocity="0 m/day"')
    return [at_most("scenes without a supply that were accepted", 1, 0, "no state is steady")]


def still(preset: str) -> list:
    """Without [flow] both ends have the supply, and uptake equals diffusion."""
    computed, fine = (hard.run_scene(runs.without_flow(hard.load("wide", name, *disc(60, *size))))
                 for name, size in ((preset, ()), ("accurate", ("numerics.refinement=1",))))
    return [computed, hard.close(computed, fine, preset, *EFFLUENTS)]


def trickle(preset: str, velocity: str, balance: float) -> list:
    """So little flow that C is uniform and one substrate is used up.

    With C_A -> 0 and C_D uniform, (7) and (8) have the ratio F + d_c f_d b / (k m_D), which gives C_D.
    """
    run = hard.run_packaged("wide", preset, *disc(60, f'flow.mean_velocity="{velocity} m/day"'), balance=balance)
    law, both = run.scene.kinetics, run.scene.substrates
    decay = channels.decay_demand(law)
    K, supply = both.donor.half_saturation, both.donor.supply

    def missing(c):
        ratio = law.acceptor_to_donor_ratio + decay * (c + K) / (law.maximum_utilization_rate * c)
        return both.acceptor.supply - ratio * (supply - c)

    remaining, u = brentq(missing, 1e-3, supply * (1 - 1e-9)), run.last["mean_velocity_m_per_d"] / M_PER_D
    peclet = u * run.last["thickness_um"] / both.donor.diffusivity_in_aggregate
    difference = abs(run.last[EFFLUENTS[1]] - remaining) / supply
    return [run,
            at_most("acceptor leaving, over the supply", run.last[EFFLUENTS[0]] / both.acceptor.supply, peclet,
                    "C varies by u R / D over the aggregate"),
            at_most("donor leaving against the closed form, over the supply", difference, peclet, "as above")]


#: Velocities (m/d), and bounds of the substrates' balances.
TRICKLES = {"1e-4": 1e-8, "1e-6": 1e-6, "1e-12": 1e-6}
STILL = HardCase(
    5, "still", "No flow, and flow so small that the inlet's condition degenerates",
    "The closed form of a pore with diffusion alone, or a refusal that names the Peclet number",
    "A singular system that is solved nevertheless; concentrations above the supply",
    {"velocity 0": no_flow, "without [flow]": still,
     **{f"{slow} m/d": partial(trickle, velocity=slow, balance=missing) for slow, missing in TRICKLES.items()}},
    refusable=("velocity 0", "1e-4 m/d", "1e-6 m/d", "1e-12 m/d"),
    mutants=("decay-demand",))


def viscous(preset: str, ratio: float) -> list:
    """A half-disc of 80 um: conductivity against a finer run, at lambda = 1 against Poiseuille's."""
    changes = disc(80, f"flow.viscosity_ratio={ratio!r}")
    run, _, checks = hard.against("wide", preset, changes, *DRIVE, *EFFLUENTS)
    if ratio == 1:
        difference = abs(run.last[DRIVE[0]] / hard.clean_conductivity(run.scene) - 1)
        checks.append(hard.promised("conductivity against Poiseuille's", difference, preset))
    return checks


def rigid(preset: str) -> list:
    """lambda from 1e5 to 1e9: the aggregate is nearly rigid."""
    soft, stiff = (hard.run_packaged("wide", preset, *disc(80, f"flow.viscosity_ratio={ratio}"))
                   for ratio in (1e5, 1e9))
    layers = [layered_channel.gradient(soft.scene.pore.width, 80.0, ratio) for ratio in (1e5, 1e9)]
    state = stiff.end.pore
    grid, speed = state.mesh, np.hypot(*stiff.end.solved.flow.velocity.T)
    through = speed[np.setdiff1d(grid.body, grid.loop)].max()
    return [soft, stiff,
            between("conductivity at 1e9 over that at 1e5", stiff.last[DRIVE[0]] / soft.last[DRIVE[0]],
                    layers[0] / layers[1], 1.0, "falls with lambda, by less than with a layer 80 um thick all along"),
            at_most("largest speed inside over the largest", through / speed.max(), 1e-5, "of the order of 1 / lambda")]


WIDTH = 50.0
ENDS = (-60.0, 70.0)
PLUG = 20.0
SECTIONS = np.array([-55.0, -30.0, -21.0, -19.0, -10.0, 0.0, 7.0, 19.0, 21.0, 40.0, 65.0])


def plugged(preset: str, size: float) -> Iterator[Check]:
    """The stage alone: biomass from wall to wall, lambda = 2000, elements of W / 4 and W / 7."""
    grid = meshes.plug(ENDS, WIDTH, PLUG, size, seed=3)
    exact = 12 / WIDTH**2 * (ENDS[1] - ENDS[0] + 1999 * 2 * PLUG)
    space = meshes.space_on(grid, hard.load("wide", preset).numerics.scheme.order)
    solution = flow.unit_flow(space, Viscous(2000.0))
    flux = meshes.section_means(space, solution.velocity[:, 0], SECTIONS, 64)
    leak, lost, origin = LEAK[size] if space.order == 1 else EXACT
    if solution.correction is not None:
        yield at_most("sources of the velocity that carries, over the flux", _sources(grid, solution), 1e-10,
                      "w = u - tau grad p is divergence-free")
    yield at_most("flux through a section against that supplied, largest difference", largest(flux - 1), leak, origin)
    yield at_most("head loss against Poiseuille's", abs(solution.loss / exact - 1), lost, origin)


#: Quadratic velocities contain the parabola.
EXACT = (1e-10, 1e-10, "round-off: the elements hold a parabola")
#: Bounds of the errors of velocity and head of the paper's scheme in a plug, by element size (um): 3.3 and 12.3 % were
#: measured on a coarse mesh, and are of second order.
COARSE = "3.3 and 12.3 % with elements of W / 4, second order"
LEAK = {12.5: (0.033, 0.123, COARSE), 7.0: (0.033 * 0.56**2, 0.123 * 0.56**2, COARSE)}


def _sources(grid, solution) -> float:
    """Largest |(w, grad N_i)| of an inner node, over the flux."""
    w = solution.velocity[grid.triangles].mean(axis=1) - solution.correction
    local = grid.areas[:, None] * np.einsum("tai,ti->ta", grid.gradients, w)
    total = np.bincount(grid.triangles.ravel(), local.ravel(), len(grid.points))
    rim = np.concatenate([grid.topology.walls, grid.topology.inlet, grid.topology.outlet])
    return largest(np.delete(total, rim)) / grid.width


VISCOUS = HardCase(
    6, "viscosity", "Viscosity ratio 1 to 1e9, and a plug on coarse meshes",
    "Poiseuille's conductivity at one, that of a rigid body at 1e9, the whole flux through every section of a plug",
    "A plug that leaks between its ends while inlet and outlet agree",
    {**{f"lambda = {ratio:g}": partial(viscous, ratio=ratio) for ratio in (1.0, 2000.0, 1e9)}, "rigid": rigid,
     **{f"plug, W / {WIDTH / size:.2g}": partial(plugged, size=size) for size in LEAK}},
    mutants=("hard-tau-of-water",))


@hard.parametrize(STARVED, EXHAUSTED, ZERO_ORDER, SATURATED, FAST, STILL, VISCOUS)
def test_stages(case, preset, record, record_property):
    hard.judge(case, preset, record, record_property)
