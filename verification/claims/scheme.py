"""C13-C15, C34: the mass balance of section 4, the effect of refinement on it, and a higher supply.

The paper compares dM_X = X_m (Omega_B(t0 + dt) - Omega_B(t0)) with dM_C = u_ave(t0) (C_supply - C_effluent(t0 + dt)) dt
(times W), and expects the ratios of the integrals of F1 to F4. Our ledger integrates F1 to F4 over the step, and closes
to round-off; the paper's dM_C uses the value at one end of the step for the entire step.

C23, C24: the conservation of reprojection, and the quality of the meshes.

C21: the steps of the paper's transient scheme.
"""

from dataclasses import dataclass, replace

import numpy as np

from repro.model import gear
from repro.model.kinetics import Sink, rate_law
from repro.model.pore import Pore
from repro.model.solving import solve
from repro.model.stages import Stages
from repro.model.transport import Concentrations
from verification.claims import (
    FEW,
    FEW_WORDS,
    LATER,
    OF_SCHEME,
    TRANSPORT,
    Dependence,
    Finding,
    at_least,
    at_most,
    claim,
    near,
    without_limit,
)
from verification.claims.levels import ALONE, BESIDE, cached
from verification.claims.runs import (
    BASE,
    PLOTTED,
    SUBSTRATES,
    UPDATE,
    Run,
    at,
    biomass_defects,
    bodies,
    full_biomass,
    grown,
    half_disc,
    ledger,
    load_packaged,
    nearest,
    series,
    solution,
    solved_pore,
    until,
)
from verification.problems.channels import both, pair
from verification.problems.schemes import exchange

PAPER_CORRECTION = 1.016
#: The scheme as printed, in which u carries the substrates, with u_x(y) in (11).
AS_PRINTED = ("numerics.preset=as_printed", exchange(inlet="local"))
#: Supply (K_s).
SUPPLY = 10.0


@dataclass(frozen=True, eq=False)
class Bookkeeping:
    """The balance of each step k of a run, by the paper's definitions and by F1 to F4 (per um of depth).

    end: (k,) h; volume: (k,) um2 of water that flows in; synthesised: (k,) biomass from F3 + F4; consumed: (2, k) from
    F1, F2; grown: (k,) the paper's dM_X; effluent: (2, k) mg/L at t0 + dt before the expansion; supply: (2, 1) mg/L.
    """

    end: np.ndarray
    volume: np.ndarray
    synthesised: np.ndarray
    consumed: np.ndarray
    grown: np.ndarray
    effluent: np.ndarray
    supply: np.ndarray

    def ratio_errors(self, correction: float = 1.0) -> np.ndarray:
        """(3, k): dM_X / dM_CA, dM_X / dM_CD and dM_CA / dM_CD over their expected values, less one; the effluents
        in dM_C are multiplied by the correction."""
        against = self.volume * (self.supply - correction * self.effluent) / self.consumed
        return np.vstack([self.grown / self.synthesised / against, against[:1] / against[1:]]) - 1

    def corrections(self) -> np.ndarray:
        """(2, k): factor on each effluent that gives dM_X / dM_C its expected value."""
        return (self.supply - self.grown / self.synthesised * self.consumed / self.volume) / self.effluent


def bookkeeping(run) -> Bookkeeping:
    """The balance of each step of a run that reports every step.

    The ledger has the mean of the outflows at the beginning and at the end of a step. The outflow at the end, before
    the expansion, follows from this mean and the outflow at the beginning.
    """
    steps = ledger(*run)
    rows = series(*run)
    scene = load_packaged(*run)
    supply = np.array(pair("supply", scene.substrates))[:, None]
    volume = steps["acceptor_supplied_pg_per_m"] / supply[0]
    out = np.array([steps[f"{name}_out_pg_per_m"] for name in SUBSTRATES])
    consumed = np.array([steps[f"{name}_consumed_pg_per_m"] for name in SUBSTRATES])
    first = np.array([rows[f"effluent_{name}_mg_per_L"][:-1] for name in SUBSTRATES])
    synthesised = steps["biomass_made_pg_per_m"]
    grown = scene.kinetics.maximum_density * np.diff(rows["aggregate_area_um2"])
    return Bookkeeping(steps["end_h"], volume, synthesised, consumed, grown, 2 * out / volume - first, supply)


#: Refinements of the meshes of C13; at 1 the mesh is that of the paper's preset.
REFINEMENTS = (0.25, 0.275, 0.3, 0.35, 0.5, 0.7, 1.0)
#: Factors on the effluents among which the best one is sought.
FACTORS = np.linspace(1.0, 1.05, 501)


@dataclass(frozen=True)
class Printed:
    """Base by the scheme as printed, at an hour.

    nodes: of the mesh; velocity: m/d; effluent, consumed: (2,) K_s, consumed in the aggregate by F1 and F2 over the
    discharge.
    """

    nodes: int
    velocity: float
    effluent: np.ndarray
    consumed: np.ndarray

    @property
    def lost(self) -> np.ndarray:
        """(2,) substrate lost, in percent of the effluent: the effluent must be raised by as much to balance."""
        return 100 * ((SUPPLY - self.consumed) / self.effluent - 1)

    def ratio_errors(self, factor: float) -> np.ndarray:
        """(3,) errors (%) of dM_X / dM_CA, dM_X / dM_CD and dM_CA / dM_CD with raised effluents."""
        against = (SUPPLY - factor * self.effluent) / self.consumed
        return 100 * (np.array([1 / against[0], 1 / against[1], against[0] / against[1]]) - 1)


@cached
def printed_scheme(refinement: float, hour: float = PLOTTED, inlet: str = "local") -> Printed:
    """Base at an hour by the scheme as printed on a mesh: u carries the substrates, in Gear's steps, and a remesh
    interpolates; inlet: the velocity in (11)."""
    pore, solved = solved_pore(("base", "numerics.preset=as_printed", exchange(inlet=inlet, transfer="interpolation"),
                                f"numerics.refinement={refinement!r}", *until(hour or UPDATE)), hour)
    discharge = solved.flow.mean_velocity * pore.mesh.width
    return Printed(len(pore.mesh.points), 24e-6 * solved.flow.mean_velocity,
                   np.array([flux.effluent for flux in solved.fluxes]),
                   np.array([flux.consumed for flux in solved.fluxes]) / discharge)


@claim("C13", "4", "mass balance from effluents within a few percent; 1.6 % on the effluents brings all ratios within "
       "1 %", about=OF_SCHEME, sizes=ALONE, steps=ALONE, fixed="its function varies the mesh", date="2026-11-29 23:24")
def papers_bookkeeping() -> Finding:
    """The scheme as printed, in which u carries the substrates and mass is lost, on meshes of several sizes: the
    correction that the effluents of base need at 19.2 h, and the errors of the three ratios with a common one. A scheme
    that conserves has no such error, and is not judged. The paper raises the effluents "throughout the whole numerical
    simulation"; the last number is the hour until which no raised effluent can balance, 4.8 h as known from E18."""
    meshes = [printed_scheme(refinement) for refinement in REFINEMENTS]
    checks, notes = [], []
    for mesh in meshes:
        errors = np.array([np.abs(mesh.ratio_errors(factor)).max() for factor in FACTORS])
        checks += [at_most(f"correction needed on the effluents, {mesh.nodes} nodes (%)", "a few",
                           float(np.abs(mesh.lost).max()), 100 * FEW, FEW_WORDS),
                   at_most(f"least error of the ratios with a common correction, {mesh.nodes} nodes (%)", "within 1",
                           float(errors.min()), 1, "the paper's bound")]
        notes.append(f"{mesh.nodes} nodes {mesh.lost[0]:.2f} and {mesh.lost[1]:.2f} %")
    checks.append(at_most("hour until which an effluent raised by 1.6 % exceeds its supply",
                          "throughout the whole numerical simulation", exceeding(bookkeeping(BASE)), 0,
                          "an effluent does not exceed its supply"))
    holds = {f"{mesh.nodes} nodes": bool(np.abs(mesh.ratio_errors(PAPER_CORRECTION)).max() <= 1) for mesh in meshes}
    return Finding(tuple(checks), reason="no common correction of the effluents brings all ratios within 1 %",
                   dependence=Dependence("the mesh, with the paper's own 1.6 % at 19.2 h", holds),
                   note=f"Substrate lost, in percent of the effluents of acceptor and donor: {', '.join(notes)} [E24]. "
                   "The mesh decides at 19.2 h; early in the run no mesh helps, since a raised effluent exceeds its "
                   "supply [E18].")


def ratio_of(correction: float, acceptor, donor):
    """dM_CA / dM_CD from effluents (K_s), numbers or arrays, times a correction."""
    return (SUPPLY - acceptor * correction) / (SUPPLY - donor * correction)


def exceeding(book: Bookkeeping) -> float:
    """Time (h) up to which an effluent raised by the paper's correction exceeds its supply."""
    excess = (PAPER_CORRECTION * book.effluent / book.supply).max(axis=0) - 1
    last = np.flatnonzero(excess > 0).max()
    return float(np.interp(0.0, -excess[last: last + 2], book.end[last: last + 2]))


def lost(scene, radius: float) -> np.ndarray:
    """(2,) substrate lost around a half-disc of X_m, meshed by 3.1: supplied - out - consumed, over what flows out; an
    effluent must be raised by this share to balance."""
    grid = half_disc(scene, radius, min(10 * radius, 1.5 * scene.pore.width))
    _, fluxes = solution(scene, grid, full_biomass(scene, grid))
    return np.array([(flux.supplied - flux.out - flux.consumed) / flux.out for flux in fluxes])


@claim("C14", "4", "refining the mesh improves the mass balance, also at early times",
       about=OF_SCHEME, sizes=BESIDE)
def refined_balance() -> Finding:
    """Substrate lost by the scheme as printed, on meshes of sizes 2, 1 and 1/2, around the seed and at 19.2 h. It has
    u_x(y) in (11): the printed u_ave loses a part that depends on no mesh [E4]."""
    radii = {"t = 0": load_packaged(*BASE).aggregate.radius, "19.2 h": at(BASE, PLOTTED)["thickness_um"]}
    scenes = [load_packaged("base", *AS_PRINTED, f"numerics.refinement={fineness}") for fineness in (0.5, 1.0, 2.0)]
    checks, defects = [], []
    for when, radius in radii.items():
        losses = np.array([lost(scene, radius) for scene in scenes])
        defects.append(f"{when}: " + ", ".join("{:.2g}/{:.2g}".format(*row) for row in 100 * losses))
        checks += [at_least(f"fall of the {name} defect per halving, {when} (times)", "improves", fall, 2,
                            "first order at least: halved with the mesh size")
                   for name, fall in zip(SUBSTRATES, (losses[:-1] / losses[1:]).min(axis=0))]
    closed = max(np.abs(series(*BASE)[f"{name}_balance"]).max() for name in SUBSTRATES)
    plain = ("u carries the substrates, as in the paper; with the default, w = u - tau grad p, the balances close to "
             f"{closed:.0e}")
    return Finding(tuple(map(without_limit, checks)), reason="refinement does not improve the balance on every mesh",
                   note=f"{plain}. Defects on the meshes, % of the acceptor/donor effluent: {'; '.join(defects)}.")


@claim("C34", "4", "at early times C_supply - C_effluent is comparable to its numerical error",
       date="2026-11-24 12:50",
       unjudged="the paper does not print the numerical error of its effluents at early times; its correction of 1.6 % "
                "cannot be this error, since an effluent raised by it exceeds the supply [E18]")
def early_drop() -> Finding:
    """C_supply - C_effluent around the seed, as a part of the effluent."""
    row, supply = at(BASE, 0.0), load_packaged(*BASE).substrates.acceptor.supply
    effluent = np.array([row[f"effluent_{name}_mg_per_L"] for name in SUBSTRATES])
    drops = " and ".join(f"{drop:.2g}" for drop in 100 * (supply / effluent - 1))
    return Finding((), note=f"At t = 0 the drop is {drops} % of the effluent, acceptor and donor.")


#: Base with twice the supply of both substrates.
RICHER = ("base", *(f'substrates.{name}.supply="20 mg/L"' for name in SUBSTRATES))


@claim("C15", "4", "a higher influent concentration leaves the amounts consumed about the same",
       date="2026-11-29 23:36")
def richer_supply() -> Finding:
    """Consumption of both substrates at 20 K_s over that at 10 K_s, in the state that the paper plots, and at 19.2 h in
    runs with both supplies from t = 0. The latter was known from `fast` when it was defined: 1.47."""
    pore, solved = grown(BASE, PLOTTED)
    scene = load_packaged(*RICHER)
    poor, rich = solved.fluxes, solve(scene, replace(pore, concentrations=None)).fluxes
    amounts = [b.consumed / a.consumed for a, b in zip(poor, rich)]
    shares = [ratio * a.supplied / b.supplied for ratio, a, b in zip(amounts, poor, rich)]
    checks = [near(f"{name} consumed at 20 K_s over 10 K_s", "about the same", ratio, 1, FEW, FEW_WORDS)
              for name, ratio in zip(SUBSTRATES, amounts)]
    checks += [at_most(f"share of the {name} consumed, 20 K_s over 10 K_s", "smaller", less, 1, "the words")
               for name, less in zip(SUBSTRATES, shares)]
    row, richer = at(BASE, PLOTTED), at(RICHER, PLOTTED)
    grown_more = richer["aggregate_area_um2"] / row["aggregate_area_um2"]
    in_runs = [_taken_up(richer, name, 2 * SUPPLY) / _taken_up(row, name, SUPPLY) for name in SUBSTRATES]
    checks += [near(f"{name} consumed in runs, 20 K_s over 10 K_s", "about the same", ratio, 1, FEW, FEW_WORDS)
               for name, ratio in zip(SUBSTRATES, in_runs)]
    law = rate_law(scene.substrates, scene.kinetics)
    m_a, m_d = law.fractions(row["acceptor_min_mg_per_L"], row["donor_min_mg_per_L"])
    reason = (f"base is not in the zero-order range at 19.2 h (C33): m_A = {m_a:.2f} and m_D = {m_d:.2f} at its lowest "
              f"concentrations, so the uptake there is {100 * m_a * m_d:.0f} % of its maximum and can rise")
    note = (f"In runs the uptake of the acceptor is {in_runs[0]:.2f} times as large, because the aggregate has grown "
            f"to {grown_more:.2f} times the area; per area it is {in_runs[0] / grown_more:.2f} times as large, since "
            "the larger aggregate lets less water through. These were known when they were added: 1.47 in `fast`.")
    return Finding(tuple(checks), reason=reason, note=note)


def _taken_up(row: dict[str, float], name: str, supply: float) -> float:
    """A substrate taken up per time and width of the pore, m/d mg/L, from a row with its supply (mg/L)."""
    return row["mean_velocity_m_per_d"] * (supply - row[f"effluent_{name}_mg_per_L"])


INSTANTS = (0.0, 5.0, 10.0, 15.0, PLOTTED)


@claim("C23", "3.4", "reprojection conserves each node's mass locally, and the total",
       about=OF_SCHEME)
def reprojection_conserves() -> Finding:
    """(34) in five updates of base: the mass of every node before and after; the total over every update of the run."""
    checks = (at_most("mass of a node: largest relative change", "conserved",
                      max(node_defect(nearest(BASE, time)) for time in INSTANTS), 1e-12, "(33) is exact; round-off"),
              at_most("total: largest relative defect of an update", "conserved",
                      np.abs(biomass_defects(BASE)).max(), 1e-10, "set beforehand; remeshes are in it"))
    rows = series(*BASE)
    return Finding(checks, note=f"The density over X_m stays between {rows['biomass_density_min'].min():.5f} and "
                   f"{rows['biomass_density_max'].max():.5f} [E7].")


def node_defect(time: float) -> float:
    """Largest relative change of a node's mass of X_A or X_I in the update of base that starts at a time (h)."""
    scene, (pore, solved) = load_packaged(*BASE), solved_pore(BASE, time)
    before_expansion, _, _ = Stages.of(scene).transport.make_biomass(pore, solved, scene.growth.time_step)
    expanded = Stages.of(scene).expand(pore, before_expansion).pore
    pairs = zip(node_masses(before_expansion), node_masses(expanded))
    return max(float(np.abs(after / before - 1).max()) for before, after in pairs)


def node_masses(pore: Pore) -> tuple[np.ndarray, np.ndarray]:
    """X_A and X_I of the aggregate's nodes, times the areas around them: um2 mg/L."""
    area = pore.space.lumped(pore.mesh.biomass)[pore.mesh.body]
    return tuple(area * pore.space.integration.to_nodes(mass / pore.space.reaction.dx)[pore.mesh.body]
                 for mass in (pore.active, pore.inert))


@claim("C24", "3.5", "the mesh degrades gradually; the remesh criterion keeps it acceptable", about=OF_SCHEME,
       steps=ALONE, date="2026-11-24 12:50",
       fixed="the claim concerns updates of 12 min")
def mesh_quality() -> Finding:
    """Quality of every mesh of base, its fall in an update, and the updates between remeshes.

    Only base is judged. The statement is about the paper's mesher; after contact a growing contact surface requires a
    new mesh in every update, whose quality is that of our mesher. The claim does not judge whether the criterion keeps
    the mesh acceptable: the run applies it, so no value could contradict it.
    """
    qualities, new = [aggregate.grid.quality for aggregate in bodies(BASE)], series(*BASE)["remeshed"]
    least = np.array([quality.min() for quality in qualities])
    updates_apart = np.diff(np.flatnonzero(new)).min()
    fall = -np.diff(least)[new[1:] == 0].min(initial=0.0)
    checks = (at_most("base: largest fall of the least quality in an update", "gradually", fall, 0.05,
                      "twice the strain of an update, 2.4 %: what a triangle can lose"),
              at_least("base: fewest updates between remeshes", "gradually", updates_apart, 5, "many updates, not one"))
    return Finding(tuple(map(without_limit, checks)), reason="it does not hold on every mesh",
                   note=f"{int(new.sum())} remeshes, at least {updates_apart} updates apart, least quality "
                   f"{least.min():.2f}.")


#: Control tolerance over the supply of a reference.
EXACT = 1e-7
#: A tolerance of the control with which the steps go from minutes to about a second.
FINE = 1e-5
FIRST = 0.0
#: Sizes of the elements; those of wide are expensive on finer meshes.
COARSER = (1.0, 2**0.5, 2.0)
#: Seconds in an hour.
HOUR = 3600.0
#: A disturbance of the profiles, and the number of steps after which it is measured.
DISTURBANCE, STEP_COUNTS = 0.01, (3, 6)


@claim("C21", "3.3.2", "predictor-corrector control: steps from minutes to about a second, accurate to 0.1 %; not "
       "stable for long steps (steps saved by the control)", about=OF_SCHEME, sizes=COARSER, steps=ALONE,
       fixed="the claim concerns the steps within the paper's update of 12 min")
def step_control() -> Finding:
    """Errors of the transport of one shape update (12 min) of base at t = 0 and 19.2 h, and the growth of a disturbance
    of the profiles in long equal steps if no biomass grows.

    The error is the largest of both concentrations (over the supply) and of the new biomass (relative), against a
    tolerance of 1e-7. The scheme is unstable if the disturbance grows from step to step; a disturbance that dies out is
    stable even if a long step is inaccurate. The range of the steps depends on the tolerance of the control, which the
    paper does not print, and on its first step. It is therefore not judged; the note has it for two tolerances.
    """
    controlled = update(PLOTTED)
    error = max(deviation(time) for time in (FIRST, PLOTTED))
    one_step_error = deviation(PLOTTED, UPDATE)
    equal_steps = next(n for n in range(2, 1000) if deviation(PLOTTED, UPDATE / n) <= deviation(PLOTTED))
    growth, damped = (growth_of_a_disturbance(simultaneous) for simultaneous in (True, False))
    in_wide = [growth_of_a_disturbance(True, ("wide", *until(*WIDE_HOURS)), hour) for hour in WIDE_HOURS]
    checks = (at_most("error with the control (%)", "within 0.1", 100 * error, 0.1, "as stated"),
              at_least("growth of a disturbance in a step of 12 min, both substrates predicted", "not stable", growth,
                       1.0, "it grows", date=LATER),
              at_least("the largest growth of a disturbance, base and wide", "not stable", max(growth, *in_wide), 1.0,
                       "it grows"),
              at_least("error of one step of 12 min (%)", "not accurate", 100 * one_step_error, 100 * TRANSPORT,
                       "as stated"),
              at_least("equal steps for the control's error, over its own", "steps saved",
                       equal_steps / len(controlled.steps), 1.5, "a third of the steps at least"))
    reason = (f"in equal steps of 12 min a disturbance changes by a factor of {growth:.2g} a step if each substrate "
              f"uses the other's prediction, and of {damped:.2g} if the donor uses the corrected acceptor: backward "
              f"differences are stable in base; long steps are inaccurate ({100 * one_step_error:.2g} %) but do not "
              f"diverge. In wide the factor is {min(in_wide):.2f} to {max(in_wide):.2f}")
    early, fine = update(FIRST), update(PLOTTED, None, FINE)
    note = (f"With the default tolerance of {gear.TOLERANCE:g} there are {_steps(early)} at t = 0 and "
            f"{_steps(controlled)} at 19.2 h, where {equal_steps} equal steps have the same error. The paper's steps, "
            f"from minutes to about a second, are those of a tolerance of {FINE:g}, with {_steps(fine)} at 19.2 h. The "
            "paper prints no tolerance, so the claim does not judge them.")
    return Finding(tuple(map(without_limit, checks)), reason=reason, note=note)


def _steps(advance: gear.Advance) -> str:
    """Describe the steps of an update."""
    return f"{len(advance.steps)} steps of {HOUR * min(advance.steps):.2g} to {HOUR * max(advance.steps):.3g} s"


#: Hours of wide at which disturbances grow or die out: before and after contact.
WIDE_HOURS = (20.0, 30.0, 33.0, 36.0, 40.0)


def growth_of_a_disturbance(simultaneous: bool, run: Run = BASE, hour: float = PLOTTED) -> float:
    """Factor by which a disturbance of the acceptor in a run at an hour changes in a step of 12 min, with constant
    biomass; simultaneous: whether each substrate uses the other's prediction."""
    pore, solved = solved_pore(run, hour)
    law = solved.problem.law
    constants = replace(law.constants, yield_coefficient=1e-12, decay_coefficient=1e-15)
    problem = replace(solved.problem, law=replace(law, constants=constants))
    rest = gear.settle(problem, Sink(pore.active), solved.concentrations)
    start = replace(rest, acceptor=(1 - DISTURBANCE) * rest.acceptor)
    ends = [gear.advance(problem, pore.active, pore.inert, start, count * UPDATE, fixed_step=UPDATE,
                         simultaneous=simultaneous).concentrations for count in STEP_COUNTS]
    early, late = (np.abs(both(end) - both(rest)).max() for end in ends)
    return float((late / early) ** (1 / (STEP_COUNTS[1] - STEP_COUNTS[0])))


@cached
def update(time: float, fixed_step: float | None = None, tolerance: float = gear.TOLERANCE) -> gear.Advance:
    """The transient of 12 min in base's geometry at a time (h), from settled profiles, in equal steps or controlled."""
    pore, solved = solved_pore(BASE, time)
    return gear.advance(solved.problem, pore.active, pore.inert, resting_profiles(time), UPDATE, tolerance=tolerance,
                        fixed_step=fixed_step)


@cached
def resting_profiles(time: float) -> Concentrations:
    """Profiles of the transient scheme with F3 = F4 = 0 (3.3.2) in base's geometry at a time (h)."""
    pore, solved = solved_pore(BASE, time)
    return gear.settle(solved.problem, Sink(pore.active), solved.concentrations)


def deviation(time: float, fixed_step: float | None = None) -> float:
    """Error of an update: the largest of both concentrations (over the supply) and of the new biomass (relative)."""
    pore, solved = solved_pore(BASE, time)
    advanced, exact = update(time, fixed_step), update(time, None, EXACT)
    gaps = np.abs(both(advanced.concentrations) - both(exact.concentrations)).max(axis=1)
    grown = [float((advance.active + advance.inert - pore.active - pore.inert).sum()) for advance in (advanced, exact)]
    return float(max(*gaps / pair("supply", solved.problem.substrates), abs(grown[0] / grown[1] - 1)))
