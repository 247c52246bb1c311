"""C20, C36: what lies between the aggregate and the pore's ends, and what happens at the outlet."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from repro.errors import TransportError
from repro.fem.newton import Newton
from repro.fem.transfer import interpolate
from repro.model import transport
from repro.model.kinetics import Sink
from repro.model.pore import Pore, Solved
from repro.model.transport import Concentrations
from repro.scene import Scene
from verification.claims import OF_SCHEME, Finding, at_most, claim, near
from verification.claims.accuracy import FEW, FEW_WORDS, TRANSPORT, TRANSPORT_WORDS
from verification.claims.levels import BESIDE, cached
from verification.claims.restored import remeshed, solved_pore
from verification.claims.runs import BASE, scene

PLOTTED = 19.2
PARTS = 64


@cached
def whole_pore(*changes: str) -> tuple[Scene, Pore, Solved]:
    """The aggregate of base at 19.2 h in a mesh of the whole pore, at the same mean velocity, solved.

    changes: KEY=VALUE of the scene, such as a longer pore.
    """
    now, solved = solved_pore(BASE, PLOTTED)
    said = scene(*BASE, 'numerics.extent="full"', *changes)
    said = replace(said, flow=replace(said.flow, head=None, mean_velocity=solved.flow.mean_velocity))
    return said, *remeshed(said, now, solved)


@claim("C20", "3.1", "(26) describes the unmeshed part", about=OF_SCHEME, sizes=BESIDE)
def upstream_profile() -> Finding:
    """Concentrations upstream in the wholly meshed pore of base at 19.2 h against (26), alpha fitted at one section.

    The section is 1 W from the aggregate, where the mesh may end (C19). Compared are the means over sections from there
    to the pore's inlet, and the range of concentrations within a section: (26) takes them as constant there.
    """
    said, now, solved = whole_pore()
    x = np.linspace(now.outline.upstream - said.pore.width, -said.pore.length / 2, 40)
    checks, parts = [], []
    for name in ("acceptor", "donor"):
        substrate, field = getattr(said.substrates, name), getattr(solved.concentrations, name)
        across = 100 * sections(now, field, x) / substrate.supply
        law = law_26(x, across[0].mean(), solved.flow.mean_velocity / substrate.diffusivity)
        bend = np.ptp(across, axis=1)
        checks += [at_most(f"{name}: error of (26) for the mean of a section (% of the supply)", "describes it",
                           np.abs(across.mean(axis=1) - law).max(), 100 * TRANSPORT, TRANSPORT_WORDS),
                   at_most(f"{name}: largest range within a section (% of the supply)", "isolines perpendicular",
                           bend.max(), 100 * FEW, FEW_WORDS)]
        parts.append(f"{name} {bend[0]:.2g} % 1 W from the aggregate, {bend[-1]:.2g} % at the pore's inlet")
    return Finding(tuple(checks), note="Range within a section: " + "; ".join(parts) + ". There (11) with the local "
                   "u_x bends the isolines [E4].")


def law_26(x: np.ndarray, first: float, rate: float) -> np.ndarray:
    """(26) at x (n,), in percent of the supply, with alpha from its value ``first`` at x[0]; rate: u_ave / D (1/um)."""
    return 100 - (100 - first) * np.exp(rate * (x - x[0]))


def sections(now: Pore, field: np.ndarray, x: np.ndarray) -> np.ndarray:
    """(n, PARTS) values of a nodal field at the middles of equal parts of the sections x (n,)."""
    heights = (np.arange(PARTS) + 0.5) / PARTS * now.mesh.width
    where = np.stack(np.meshgrid(x, heights, indexing="ij"), axis=-1).reshape(-1, 2)
    nodal = now.space.to_mesh(field)[:, None]
    return interpolate(now.mesh.points, now.mesh.cells, nodal, where).reshape(len(x), PARTS)


LENGTHS = (600.0, 900.0, 1200.0)


@claim("C36", "2.2", "the flux is not affected by the condition at the downgradient end (12), if the channel is long "
       "enough")
def downgradient_end() -> Finding:
    """What the aggregate of base at 19.2 h takes up, with other places of the outlet and other values held there.

    At one mean velocity. (12) at the end of the meshed part and of the whole pore; then C held at the pore's end at
    nothing, and at the supply: the least and the most that a next pore can offer; then the same in longer pores.
    """
    said, *full = whole_pore()
    central = remeshed(replace(said, numerics=scene(*BASE).numerics), *solved_pore(BASE, PLOTTED))
    effects = np.array([end_effect(f'pore.length="{length} um"') for length in LENGTHS])
    rate = said.flow.mean_velocity / said.substrates.acceptor.diffusivity
    decay = np.log(effects[1] / effects[2]) / (0.5 * (LENGTHS[2] - LENGTHS[1])) / rate
    checks = (at_most("uptake, (12) put at the end of the meshed part: change (%)", "not affected",
                      apart(uptake(*central), uptake(*full)), 100 * TRANSPORT, TRANSPORT_WORDS),
              at_most("uptake, any value held at the end of 600 um: change (%)", "not affected", effects[0],
                      100 * FEW, FEW_WORDS),
              near("its decay with the pore's length, over u_ave / D_A", "if long enough", decay, 1.0, relative=0.05,
                   why="(25): exp(-u x / D) upstream; 5 %, since the donor's part fades sooner"))
    told = ", ".join(f"{effect:.2g} % at {length:g} um" for effect, length in zip(effects, LENGTHS))
    return Finding(checks, note=f"Largest change of the uptake with C held at nothing or at the supply at the pore's "
                   f"end: {told}. The flux that enters is u_ave W C_supply whatever happens downstream, by (11).")


def uptake(now: Pore, solved: Solved) -> np.ndarray:
    """(2,) acceptor and donor consumed, um2 mg/L/h."""
    fluxes = transport.fluxes(solved.problem, Sink(now.active), solved.concentrations)
    return np.array([flux.consumed for flux in fluxes])


def end_effect(*changes: str) -> float:
    """Largest change (%) of the uptake with C at the pore's end held at nothing, or at the supply."""
    _, now, solved = whole_pore(*changes)
    return max(apart(uptake(now, held(now, solved, part)), uptake(now, solved)) for part in (0.0, 1.0))


def held(now: Pore, solved: Solved, part: float) -> Solved:
    """Solved again with both concentrations at the outlet held at a part of their supply, instead of (12)."""
    problem, state = solved.problem, solved.concentrations
    at_the_end = np.zeros(problem.space.count, bool)
    at_the_end[problem.space.end_nodes(problem.space.dofs.outlet)] = True
    rows = np.tile(at_the_end, 2)
    problem = replace(problem, system=problem.system.holding(rows))
    guess = 0.5 * np.concatenate([state.acceptor, state.donor])
    guess[rows] = part * problem.supply[rows]
    balance = transport.Balance(problem, Sink(now.active))
    newton = Newton(transport.NEWTON, transport.ROUND_OFF, transport.MOST_ITERATIONS)
    last, _, converged = newton.solve(balance, balance.begun(guess))
    if not converged:
        raise TransportError(f"Newton's method stands at a defect of {last.defect:.2g}")
    return replace(solved, problem=problem, concentrations=Concentrations(*last.state.reshape(2, -1)))


def apart(ours: np.ndarray, other: np.ndarray) -> float:
    """Largest relative difference, %."""
    return 100 * float(np.abs(ours / other - 1).max())
