"""Flow around a half-disc of 40 um in a pore of 50 um, lambda = 2000: error of the head loss of the whole pore."""

from __future__ import annotations

from functools import cache, partial

from reference import taylor_hood
from repro.fem.space import Space
from repro.model import flow, pore
from verification.bench import pores
from verification.bench.clock import measured

REPEATS = 3
#: Rings of the reference, the last one being it.
RINGS = (16, 24)
LINEAR, QUADRATIC = (0.35, 0.5, 0.7, 1.0, 1.4, 2.0, 2.8), (0.15, 0.25, 0.45, 0.7, 1.0, 1.6)
SKFEM, SECTIONS = (0, 1, 2), (3, 4, 6, 8)


def run(quick: bool) -> dict:
    """The part."""
    rings, linear, quadratic, skfem, sections = (
        ((6, 9), (0.35, 0.7), (0.25, 0.45), (0,), (3,)) if quick else (RINGS, LINEAR, QUADRATIC, SKFEM, SECTIONS))
    coarse, truth = reference(rings[-2]), reference(rings[-1])
    jobs = {}
    for interface, element in pores.FLOW_ELEMENTS.items():
        for r in linear:
            jobs[interface, f"refinement {r:g}"] = partial(_linear, truth, r, **element)
    for r in linear[: len(linear) - 2]:
        jobs["order 2 on straight triangles", f"refinement {r:g}"] = partial(_of_order, truth, r, "paper", 2)
    for order, name in ((2, "order 2 on curved triangles (fast, accurate)"), (3, "order 3 on curved triangles")):
        for r in quadratic:
            jobs[name, f"refinement {r:g}"] = partial(_of_order, truth, r, "accurate", order)
    for k in skfem:
        jobs["scikit-fem: Taylor-Hood, two pressures", f"{k} refinements"] = partial(_taylor_hood, truth, k)
    for n in sections:
        jobs["scikit-fem: Taylor-Hood, rings", f"{n} rings"] = partial(_section, truth, n)
    lines = measured(jobs, 1 if quick else REPEATS)
    for name in ("fipy", "py-pde"):
        lines.append({"method": name, "points": [], "failed": [{"label": "Stokes flow with a jump of viscosity",
                                                                "reason": "has no incompressible flow of this kind"}]})
    return {"title": "Flow: half-disc of 40 um in a pore of 50 um, lambda = 2000; mesh, assembly and solution",
            "error": "head loss of the whole pore, relative", "repeats": 1 if quick else REPEATS, "lines": lines,
            "reference": f"Taylor-Hood on curved triangles, {rings[-1]} rings: {truth:.9g} 1/um; from {rings[-2]} to "
                         f"{rings[-1]} rings it changes by {abs(coarse / truth - 1):.1e}",
            "reference_change": abs(coarse / truth - 1)}


@cache
def reference(rings: int) -> float:
    """Head loss at mean velocity one, 1/um: pressures of their own on both sides of the interface."""
    return pores.section(rings).flow(pores.RATIO).loss + pores.outside_loss()


def _linear(truth: float, refinement: float, **element) -> dict:
    scene = pores.scene(refinement=refinement, **element)
    mesh = pore.seeded(scene).mesh
    found = pore.solve_flow(scene, Space(mesh, 1))
    return _judged(truth, found.head_loss / scene.flow.mean_velocity / _nu(scene), mesh)


def _nu(scene) -> float:
    return scene.flow.kinematic_viscosity / scene.flow.gravity


def _of_order(truth: float, refinement: float, preset: str, order: int) -> dict:
    mesh = pore.seeded(pores.scene(preset=preset, refinement=refinement)).mesh
    return _judged(truth, flow.unit_flow(Space(mesh, order), pores.RATIO).loss + pores.outside_loss(), mesh)


def _taylor_hood(truth: float, refinements: int) -> dict:
    return {"error": abs(_stokes(refinements) / truth - 1)}


def _stokes(refinements: int) -> float:
    channel = taylor_hood.half_disc(pores.WIDTH, pores.ENDS, pores.RADIUS, refinements, corner=2 + refinements)
    return taylor_hood.stokes(channel, pores.RATIO).loss + pores.outside_loss()


def _section(truth: float, rings: int) -> dict:
    return {"error": abs(reference.__wrapped__(rings) / truth - 1)}


def _judged(truth: float, loss: float, mesh) -> dict:
    return {"error": abs(loss / truth - 1), "nodes": len(mesh.points)}
