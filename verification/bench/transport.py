"""Both substrates around the half-disc of the flow part, dual Monod uptake: error of the effluents over the supply.

Flow of the same elements on the same mesh is found beforehand, and neither it nor the mesh is counted: error is of both
flow and transport, time of transport alone.
"""

from __future__ import annotations

from functools import cache, partial

import numpy as np

from repro.curved import flow as curved_flow
from repro.curved import pore as curved_pore
from repro.curved import transport as curved_transport
from repro.model import pore, transport
from verification.bench import options, pores
from verification.bench.clock import measured

REPEATS = 5
RINGS = (16, 24)
LINEAR, QUADRATIC = (0.5, 0.7, 1.0, 1.4, 2.0, 2.8), (0.15, 0.25, 0.45, 0.7, 1.0)
SECTIONS = (3, 4, 6, 8)


def run(quick: bool) -> dict:
    """The part."""
    rings, linear, quadratic, sections = ((6, 9), (0.5, 0.7), (0.25,), (3,)) if quick else (
        RINGS, LINEAR, QUADRATIC, SECTIONS)
    coarse, truth = reference(rings[0]), reference(rings[1])
    jobs = {}
    for name, element in options.flow_elements():
        jobs |= {(name, f"refinement {r:g}"): _linear(truth, r, element) for r in linear}
    for order, name in ((2, "order 2 on curved triangles (fast, accurate)"), (3, "order 3 on curved triangles")):
        jobs |= {(name, f"refinement {r:g}"): _curved(truth, r, order) for r in quadratic}
    jobs |= {("scikit-fem: quadratic elements", f"{n} rings"): partial(_section, truth, *prepared(n)) for n in sections}
    repeats, change = 1 if quick else REPEATS, pores.largest(coarse, truth, supply())
    return {"title": "Transport: dual Monod uptake around a half-disc of 40 um in a pore of 50 um, 2.9 m/d; assembly "
                     "and solution", "error": "effluents over the supply, the larger error",
            "repeats": repeats, "lines": measured(jobs, repeats),
            "reference": f"quadratic elements on curved triangles, {rings[1]} rings: {truth[0]:.8f} and "
                         f"{truth[1]:.8f} mg/L; from {rings[0]} rings on they change by {change:.1e} of the supply",
            "reference_change": change}


def supply() -> np.ndarray:
    """(2,) mg/L."""
    return np.array(pores.constants().supply)


def prepared(rings: int):
    """(section, its flow)."""
    section = pores.section(rings)
    return section, section.flow(pores.RATIO)


@cache
def reference(rings: int) -> np.ndarray:
    """(2,) effluents, mg/L."""
    return _effluents(*prepared(rings))


def _effluents(section, flow) -> np.ndarray:
    given = pores.constants()
    operators = section.operators(given, pores.SPEED / 24e-6, flow)
    start = np.multiply.outer(given.supply, np.ones(section.whole.N))
    fields = section.steady(operators, np.full(section.body.dx.shape, given.density), given.rates, start)
    return section.effluents(flow, fields)


def _section(truth, section, flow) -> dict:
    return {"error": pores.largest(_effluents(section, flow), truth, supply())}


def _linear(truth, refinement: float, element: dict):
    scene = pores.scene(refinement=refinement, **element)
    now = pore.seeded(scene)
    return partial(_solved, truth, scene, now, now.active, pore.solve_flow(scene, now), transport)


def _curved(truth, refinement: float, order: int):
    scene = pores.scene(preset="accurate", refinement=refinement)
    now = curved_pore.seeded(scene)
    found = curved_flow.solve(now.mesh, scene.flow, scene.pore.length, order)
    return partial(_solved, truth, scene, now, curved_pore.active_biomass(scene, now), found, curved_transport,
                   order=order)


def _solved(truth, scene, now, active, flow, stage, **order) -> dict:
    now.mesh.topology.clear()  # orderings and sparsity too are worked out anew
    problem = stage.problem(now.mesh, flow, scene.substrates, scene.kinetics, **order)
    found = stage.fluxes(problem, active, stage.steady(problem, active))
    return {"error": pores.largest([flux.effluent for flux in found], truth, supply()), "nodes": len(now.mesh.points)}
