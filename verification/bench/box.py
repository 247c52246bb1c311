"""Diffusion and dual Monod uptake in a box with a block of biomass, whose sides follow the cells: what FiPy and py-pde
can do as well; error of what is taken up."""

from __future__ import annotations

from functools import cache, partial

import numpy as np
from scipy.sparse import block_array
from scipy.sparse.linalg import splu
from skfem import Basis, BilinearForm, ElementTriP2, LinearForm, MeshTri, asm
from skfem.helpers import dot, grad

from reference import diffusion_reaction_pypde as pypde
from reference.monod import NUDGE, uptake
from verification.bench import pores, users
from verification.bench.clock import measured

REPEATS = 3
HALF, WIDTH, SIDE = 64.0, 64.0, 32.0
#: Cells across the box.
LINEAR, QUADRATIC, SKFEM, CELLS, STEPPED = (8, 16, 32, 64, 96), (2, 4, 8, 16, 24), (4, 8, 16), (8, 16, 32, 64), (16,)
REFERENCE = (32, 64)


def run(quick: bool) -> dict:
    """The part. py-pde's compiled run comes once a grid: numba compiles for longer than it runs."""
    linear, quadratic, skfem, cells, stepped, reference = ((8, 16), (2, 4), (4,), (8,), (), (8, 16)) if quick else (
        LINEAR, QUADRATIC, SKFEM, CELLS, STEPPED, REFERENCE)
    coarse, truth = converged(reference[0]), converged(reference[1])
    given, repeats = users.scene(), 1 if quick else REPEATS
    jobs = {(pores.PAPER, f"{n} cells"): partial(_ours, truth, given, n, 1) for n in linear}
    jobs |= {("order 2 (fast, accurate)", f"{n} cells"): partial(_ours, truth, given, n, 2) for n in quadratic}
    jobs |= {("order 3", f"{n} cells"): partial(_ours, truth, given, n, 3) for n in quadratic}
    jobs |= {("scikit-fem: quadratic elements", f"{n} cells"): partial(_skfem, truth, n) for n in skfem}
    jobs |= {("fipy", f"{n} cells"): partial(_fipy, truth, n) for n in cells}
    jobs |= {("py-pde's Laplacian, Newton by scipy", f"{n} cells"): partial(_newton, truth, n) for n in cells}
    lines = measured(jobs, repeats)
    lines += measured({("py-pde, compiled", f"{n} cells"): partial(_stepped, truth, n) for n in stepped}, 1)
    change = pores.largest(coarse, truth, truth)
    return {"title": "Uptake without flow: a block of 64 by 32 um in a box of 128 by 64 um; grid, assembly, solution",
            "error": "what is taken up of each substrate, relative, the larger error", "repeats": repeats,
            "lines": lines, "apart": compile_times(lines), "reference_change": change,
            "reference": f"quadratic elements of scikit-fem, {reference[1]} cells across: {truth[0]:.9g} and "
                         f"{truth[1]:.9g} um2 mg/L/h; from {reference[0]} cells on they change by {change:.1e}"}


def compile_times(lines: list[dict]) -> list[dict]:
    """What numba took, which no point includes."""
    return [{"what": f"{line['method']}, {point['label']}: compilation", "seconds": point["apart_seconds"]}
            for line in lines for point in line["points"] if point.get("apart_seconds")]


def problem() -> users.Problem:
    """The same, as other codes take it."""
    given = pores.constants()
    return users.Problem((-HALF, HALF), WIDTH, _inside, users.DENSITY, given.supply, users.DIFFUSIVITY, given.rates)


def _inside(x, y):
    return (np.abs(x) < SIDE) & (y < SIDE)


def _judged(truth, found) -> dict:
    return {"error": pores.largest(found, truth, truth)}


def _ours(truth, given, cells: int, order: int) -> dict:
    grid = users.straight((-HALF, HALF), WIDTH, (2 * cells, cells), _inside)
    return _judged(truth, [flux.consumed for flux in users.solved(given, grid, order)])


def _fipy(truth, cells: int) -> dict:
    return _judged(truth, users.fipy(problem(), cells)[0])


def _stepped(truth, cells: int) -> dict:
    found, _, compiled = users.py_pde(problem(), cells)
    return {**_judged(truth, found), **compiled}


def _newton(truth, cells: int) -> dict:
    given, box = problem(), pypde.Box(cells, HALF, WIDTH, pypde.block(SIDE, SIDE))
    fields = box.steady(given.diffusivity, given.supply, given.density, given.rates)
    return _judged(truth, given.amounts(fields, given.density * box.part * (WIDTH / cells) ** 2))


def _skfem(truth, cells: int) -> dict:
    return _judged(truth, quadratic(cells))


@cache
def converged(cells: int) -> np.ndarray:
    """(2,) what is taken up, by the finest meshes."""
    return quadratic(cells)


def quadratic(cells: int) -> np.ndarray:
    """(2,) what is taken up, by scikit-fem's quadratic elements and Newton's method."""
    given = problem()
    mesh = MeshTri.init_tensor(np.linspace(-HALF, HALF, 2 * cells + 1), np.linspace(0.0, WIDTH, cells + 1))
    whole = Basis(mesh, ElementTriP2(), intorder=6)
    body = Basis(mesh, ElementTriP2(), intorder=6, elements=np.flatnonzero(_inside(*mesh.p[:, mesh.t].mean(axis=1))))
    laplace = asm(_laplace, whole)
    fields = np.outer(given.supply, np.ones(whole.N))
    inner = np.flatnonzero(np.abs(whole.doflocs[0]) < HALF * (1 - 1e-9))
    step = np.inf
    while np.abs(step).max() > 1e-10:
        here = np.array([body.interpolate(field) for field in fields])
        residual = [d * (laplace @ field) + asm(_load, body, value=given.density * q)
                    for d, field, q in zip(given.diffusivity, fields, uptake(*here, given.rates))]
        blocks = _slopes(body, here, given)
        for k, d in enumerate(given.diffusivity):
            blocks[k][k] = blocks[k][k] + d * laplace
        blocks = [[block.tocsr()[inner][:, inner] for block in row] for row in blocks]
        right = np.concatenate([part[inner] for part in residual])
        step = -splu(block_array(blocks, format="csc")).solve(right).reshape(2, -1)
        fields[:, inner] += step
    here = np.array([body.interpolate(field) for field in fields])
    return np.array([np.sum(given.density * q * body.dx) for q in uptake(*here, given.rates)])


def _slopes(body, here, given) -> list[list]:
    """Matrices of the uptake's derivatives, by central differences."""
    columns = [(np.array(uptake(*(here + d), given.rates)) - np.array(uptake(*(here - d), given.rates))) / (2 * NUDGE)
               for d in NUDGE * np.eye(2)[:, :, None, None]]
    return [[asm(_mass, body, value=given.density * column[k]) for column in columns] for k in (0, 1)]


@BilinearForm
def _laplace(u, v, w):
    return dot(grad(u), grad(v))


@BilinearForm
def _mass(u, v, w):
    return w["value"] * u * v


@LinearForm
def _load(v, w):
    return w["value"] * v
