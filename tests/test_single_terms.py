"""Verdicts, bars and criteria with several terms: cases in which exactly one term decides."""
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from repro import load_scene
from repro.fem import sizing
from repro.fem.outline import TOP
from repro.model.pore import Meshing, seeded, sized
from repro.model.remeshing import moved_mesh
from tests.test_sensitivity import value_of
from verification.sensitivity import rounding
from verification.sensitivity.rounding import INPUTS
from verification.uncertainty import OBSERVED, estimate

SIZES = np.array([1.0, 2**0.5, 2**-0.5, 0.5])


# The bar of a number on several sizes: the law's error, the scatter about the law, and the number's distance from it.
def parts(sizes, values, order):
    """The three terms of a bar with an order, by NumPy's least squares."""
    law = np.column_stack([np.ones(len(sizes)), sizes**order])
    coefficients = np.linalg.lstsq(law, values, rcond=None)[0]
    residual = values - law @ coefficients
    scatter = (residual @ residual / max(len(sizes) - 3, 1)) ** 0.5
    return OBSERVED * abs(coefficients[1]) * sizes[0] ** order, scatter, abs(residual[0])


@given(st.lists(st.floats(-0.15, 0.15), min_size=4, max_size=4), st.floats(0.6, 2.0), st.sampled_from([1.0, -1.0]))
def test_a_bar_is_the_sum_of_its_three_terms(noise, order, sign):
    """This holds for a law with any noise, if the observed order is accepted."""
    values = 7.0 + sign * (SIZES**order + noise)
    result = estimate(SIZES, values, (1.0, 2.0))
    if result.factor == OBSERVED:
        assert result.bar == pytest.approx(sum(parts(SIZES, values, min(result.order, 1.0))), rel=1e-6)


# A set of inputs is reached if it is within the rounding, and the complete bar of each number is in its interval.
class Scattered:
    """Numbers that follow from inputs and element size by a law; they replace runs."""

    def __init__(self, law):
        self.law = law

    def get(self, scene):
        packaged = load_scene(scene.name)
        factors = {each.name: value_of(scene, each.paths[0]) / value_of(packaged, each.paths[0])
                   for each in INPUTS if each.only in ("", scene.name)}
        return self.law(factors, load_scene("base", rounding.converged(1.0)).numerics.refinement
                        / scene.numerics.refinement)

    def get_all(self, scenes):
        return [*map(self.get, scenes)]


def numbers(effluent):
    """The numbers of section 4 in the middle of their intervals, except the effluent."""
    middles = dict(zip(rounding.PRINTED, map(float, rounding.MIDDLE)))
    return middles | {"effluent_acceptor": effluent}


def curved(x, size):
    """The linear program needs more than the rounding of k, but a run at the end of the rounding fits."""
    change = 1 - x["k"]
    return numbers(4.19 * (0.95 + 4 * change + 1e3 * change**2))


def scattering(x, size):
    """The effluent fits within the rounding, but its values on several sizes scatter for that set."""
    change = 1 - x["k"]
    return numbers(4.19 * (0.99 + 8 * change) + (0.02 * size if abs(change) > 1e-4 else 0.0))


def straight(x, size):
    """The effluent fits within the rounding, without a bar."""
    return numbers(4.19 * (0.99 + 8 * (1 - x["k"])))


@pytest.mark.parametrize("law, within, fits", [
    (straight, True, True), (curved, False, True), (scattering, True, False)])
def test_a_set_is_reached_if_it_is_within_the_rounding_and_fits_with_its_bars(law, within, fits):
    """Neither condition alone suffices."""
    slope = -4.0 if law is curved else -8.0
    elasticities = {number: {each.name: {"elasticity": 0.0} for each in INPUTS} for number in rounding.PRINTED}
    elasticities["effluent_acceptor"]["k"] = {"elasticity": slope}
    result = rounding.one_set(Scattered(law), elasticities)
    assert (result["share_of_the_rounding"] <= 1, result["misfit_in_half_intervals"] <= 1) == (within, fits)
    assert result["reached"] is (within and fits)


# A new mesh is due if one of the criteria of 3.1, 3.5 and 2.3.3 requires it.
def grown_seed(elements):
    """(scene, its seed)."""
    scene = load_scene("base", ["aggregate.radius=20 um", "numerics.refinement=0.5", f"numerics.elements={elements}"])
    return scene, seeded(scene)


def shifted(scene, pore):
    """The seed 16 um upstream, too near to the end of the mesh, which is 75 um away at first."""
    return scene, pore.moved(pore.mesh.points - [16.0, 0.0])


def touching(scene, pore):
    """A node at the top is on the opposite wall."""
    wall = pore.wall.copy()
    wall[pore.boundary.points[:, 1].argmax()] = TOP
    return scene, replace(pore, wall=wall)


def coarse(scene, pore):
    """The scene requires elements a third as large."""
    return replace(scene, numerics=replace(scene.numerics, refinement=3 * scene.numerics.refinement)), pore


def inner(pore):
    """Corners of the aggregate's triangles that are not on its boundary."""
    return np.setdiff1d(pore.mesh.topology.body_corners, pore.mesh.loop)


def poor(scene, pore):
    """The inside of the aggregate is compressed: triangles at the boundary are poor, and none is turned over."""
    points = pore.mesh.points.copy()
    points[inner(pore)] = [0.0, 8.5] + 0.75 * (points[inner(pore)] - [0.0, 8.5])
    moved = pore.mesh.with_middles(points[: pore.mesh.corners])
    return scene, pore.moved(moved)


def turned_over(scene, pore):
    """One inner node lies outside of the few triangles around it."""
    points = pore.mesh.points.copy()
    points[inner(pore)[0]] += [0.0, 14.0] if points[inner(pore)[0], 1] < 8 else [0.0, -14.0]
    return scene, pore.moved(pore.mesh.with_middles(points[: pore.mesh.corners]))


def unchanged(scene, pore):
    return scene, pore


def criteria(scene, pore, expanded):
    """{criterion: does it require a new mesh}. By 3.5, at most six triangles may have a quality under 0.6."""
    outline, ends, body = expanded.boundary, pore.mesh.ends, expanded.mesh
    reach = min(7 * outline.thickness, 1.3 * scene.pore.width)
    required = sizing.interface_sizes(outline.corners, sized(scene)).max()
    return {"extent": min(outline.upstream - ends[0], ends[1] - outline.downstream) < reach,
            "contact": bool((expanded.wall != pore.wall).any()),
            "size": outline.corners.edge_lengths()[outline.corners.interface_edges()].max() > 2.8 * required,
            "poor": np.count_nonzero(body.quality[body.biomass] < 0.6) > 6,
            "turned": bool((body.areas <= 0).any())}


@pytest.mark.parametrize("kind", ["linear", "quadratic"])
@pytest.mark.parametrize("change, criterion", [(unchanged, None), (shifted, "extent"), (touching, "contact"),
                                            (coarse, "size"), (poor, "poor"), (turned_over, "turned")])
def test_a_new_mesh_is_due_if_one_criterion_requires_it(change, criterion, kind):
    first = grown_seed(kind)
    scene, expanded = change(*first)
    assert (moved_mesh(Meshing.of(scene), first[1], expanded) is None) == (criterion is not None)
    due = [name for name, is_due in criteria(scene, first[1], expanded).items() if is_due]
    assert due == [*filter(None, [criterion])]
