"""Both substrates around the half-disc of the flow part, dual Monod uptake: error of the effluents over the supply.

Flow of the same elements on the same mesh is found beforehand, and neither it nor the mesh is counted: error is of both
flow and transport, time of transport alone.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache, partial

import numpy as np

from repro.fem.space import Space
from repro.model import pore, transport
from repro.model.kinetics import Sink
from verification.bench import pores
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
    for name, element in pores.FLOW_ELEMENTS.items():
        jobs |= {(name, f"refinement {r:g}"): _ours(truth, 1, refinement=r, **element) for r in linear}
    for order, name in ((2, "order 2 on curved triangles (fast, accurate)"), (3, "order 3 on curved triangles")):
        jobs |= {(name, f"refinement {r:g}"): _ours(truth, order, preset="accurate", refinement=r) for r in quadratic}
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


def _ours(truth, order: int, **numerics):
    scene = pores.scene(**numerics)
    now = pore.seeded(scene)
    space = Space(now.mesh, order)
    return partial(_solved, truth, scene, space, pore.solve_flow(scene, space))


def _solved(truth, scene, space, flow) -> dict:
    space = Space(replace(space.mesh, topology=replace(space.mesh.topology)), space.order)  # nothing is known of it
    problem = transport.problem(space, flow, scene.substrates, scene.kinetics)
    sink = Sink(scene.kinetics.maximum_density * space.reaction.dx)
    found = transport.fluxes(problem, sink, transport.steady(problem, sink))
    return {"error": pores.largest([flux.effluent for flux in found], truth, supply()), "nodes": len(space.mesh.points)}
