"""Hostile outlines, drawn by seed: each runs in bounded time and memory, or is refused before anything is written.

The case hard-family has thin films and seeds beside the pore's ends.
"""
import math
import random
from dataclasses import replace

import numpy as np
import pytest

from repro.cli import main
from repro.errors import SimulationError
from repro.fem import mesher, sizing
from repro.march.simulation import simulate
from repro.model.meshing import seeded
from repro.preflight import memory
from repro.preflight.checked import check
from repro.scene import SceneError, load_scene, packaged_scenes, parse_scene
from tests.shell import refusal
from tests.strategies import in_um

#: The most nodes that any outline of at most 1000 points may need in the preset fast.
MOST_NODES = 30_000
WIDTH = 100.0


def log_between(draw, least, most):
    return math.exp(draw.uniform(math.log(least), math.log(most)))


def sliver(draw):
    height, half = log_between(draw, 0.02, 2), draw.uniform(20, 200)
    return [(-half, 0), (-half * draw.uniform(0.5, 0.99), height), (half * draw.uniform(0.5, 0.99), height), (half, 0)]


def wedge(draw):
    half = draw.uniform(10, 100)
    return [(-half, 0), (-half + log_between(draw, 0.2, 10), log_between(draw, 0.05, 2)), (half, 0)]


def needle(draw):
    thickness = log_between(draw, 0.11, 5)
    return [(-20, 0), (-20, 5), (-thickness / 2, 5), (0, draw.uniform(20, 95)), (thickness / 2, 5), (20, 5), (20, 0)]


def overhang(draw):
    gap, half = log_between(draw, 1e-8, 5), draw.uniform(10, 50)
    if draw.random() < 0.5:
        return [(-half, 0), (-half, 30), (half + 10, 30), (half + 10, gap), (half, 20), (half, 0)]
    return [(-half, 0), (-half, WIDTH), (half, WIDTH), (half + 50, WIDTH - gap), (half + 1, 50), (half, 0)]


def fold(draw):
    gap, bottom = log_between(draw, 1e-4, 2), log_between(draw, 0.5, 20)
    return [(-30, 0), (-30, 40), (-gap, 40), (-gap / 2, bottom), (gap / 2, bottom), (gap, 40), (30, 40), (30, 0)]


def many_points(draw):
    count, radius, waves = draw.randint(300, 999), draw.uniform(32, 60), draw.randint(1, 20)
    angles = [math.pi * (1 - k / count) for k in range(count + 1)]
    curve = [(radius * (1 + 0.02 * math.sin(waves * a)) * math.cos(a), radius * math.sin(a)) for a in angles]
    return [(-radius, 0), *curve[1:-1], (radius, 0)]


def tiny_and_huge_edges(draw):
    edge, half = log_between(draw, 0.1, 0.5), draw.uniform(20, 150)
    return [(-half, 0), (-half + edge, edge), (-half + 2 * edge, edge), (-half + 3 * edge, 2 * edge),
            (0, draw.uniform(5, 90)), (half, 0)]


FAMILIES = [sliver, wedge, needle, overhang, fold, many_points, tiny_and_huge_edges]


def scene(points, preset="fast"):
    return parse_scene({
        "pore": {"width": f"{WIDTH} um"}, "aggregate": {"outline": in_um(points)},
        "flow": {"mean_velocity": "2.9 m/day"},
        "substrates": {"acceptor": {"supply": "10 mg/L"}, "donor": {"supply": "10 mg/L"}}, "kinetics": {},
        "growth": {"end": "0.2 h"}, "numerics": {"preset": preset}}, "odd", "odd.toml")


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.thorough) for seed in range(1, 8))])
@pytest.mark.parametrize("family", FAMILIES)
def test_a_hostile_outline_has_a_first_row_or_is_refused_by_its_scene(family, seed):
    """The refusal is one line with the requirement. The number of nodes is within a factor of two of the estimate, and
    below the limit for any outline. If the mesh is too coarse for the first state, a larger refinement resolves it."""
    points = family(random.Random(seed))
    try:
        accepted = scene(points)
    except SceneError as error:
        assert "aggregate.outline" in str(error) and " is needed" in str(error) and "\n" not in str(error)
        return
    expected = memory.first_nodes(accepted)
    assert expected < MOST_NODES
    nodes = len(seeded(accepted).mesh.points)
    assert expected / 2 < nodes < 2 * expected
    if nodes < 3000:
        assert first_row(accepted).pore.time == 0


def first_row(accepted):
    """The first row of a run, with up to three times the refinement if the run advises a larger one."""
    numerics = accepted.numerics
    for factor in (1.0, 1.5, 2.0):
        tried = replace(accepted, numerics=replace(numerics, refinement=factor * numerics.refinement))
        try:
            return next(simulate(tried))
        except SimulationError as error:
            assert "try a larger numerics.refinement" in str(error)
    return next(simulate(replace(tried, numerics=replace(numerics, refinement=3 * numerics.refinement))))


@pytest.mark.parametrize("preset, nodes", [("fast", 6000), ("accurate", 12_000), ("paper", 12_000)])
def test_a_sliver_needs_no_more_elements_than_its_length(preset, nodes):
    """A body is 0.1 um thick and 400 um long. Edges of a tenth of its thickness would be 40 000 in paper."""
    thin = scene([(-200, 0), (-199, 0.1), (199, 0.1), (200, 0)], preset)
    assert memory.first_nodes(thin) < 2 * nodes
    assert len(seeded(thin).mesh.points) < nodes


@pytest.mark.parametrize("name", packaged_scenes())
def test_the_bound_on_elements_leaves_half_discs_as_they_are(name, monkeypatch):
    mesh = seeded(load_scene(name)).mesh
    monkeypatch.setattr(sizing, "ALONG_INTERFACE", 1e9)
    assert np.array_equal(mesh.points, seeded(load_scene(name)).mesh.points)


@pytest.mark.parametrize("points, needed", [
    ([(-30, 0), (-20, 99.9999), (20, 90), (30, 0)], "between point 2 (-20 um, 99.9999 um) and a wall"),
    ([(-30, 0), (-20, 0.0099), (20, 90), (30, 0)], "between point 2 (-20 um, 0.0099 um) and a wall"),
    ([(-299.9999, 0), (-20, 30), (30, 0)], "between point 1 (-300 um, 0 um) and the pore's end"),
    ([(-30, 0), (-20, 30), (299.9999, 20), (30, 0)], "between point 3 (300 um, 20 um) and the pore's end"),
    ([(-0.04, 0), (-20, 30), (20, 30), (0.04, 0)], "between the first and the last point"),
    ([(-30, 0), (-30, 30), (-0.06, 30), (0, 10), (0.06, 30), (30, 30), (30, 0)], ""),
    ([(-30, 0), (-30, 30), (-0.04, 30), (-0.04, 10), (0.04, 10.5), (0.04, 30), (30, 30), (30, 0)],
     "between the lines after points 2 and 5"),
])
def test_gaps_that_no_mesh_resolves_are_refused(points, needed):
    """The least gap is a thousandth of the width between edges, and a ten-thousandth at a wall or an end."""
    if not needed:
        assert scene(points)
        return
    with pytest.raises(SceneError, match="aggregate.outline = ") as refusal:
        scene(points)
    assert needed in str(refusal.value)


@pytest.mark.parametrize("command", ["check", "run"])
@pytest.mark.parametrize("points, needed", [
    ([(-20, 0), (-20, 99), (0, 99), (1, 99), (20, 0)], "leaves the pore"),
    ([(-30, 0), (-20, 50), (-19, 1), (-18, 50), (0, 99), (30, 0)], "crosses itself"),
])
def test_a_spline_that_is_no_outline_is_refused_before_anything_is_written(tmp_path, capsys, command, points, needed):
    path = tmp_path / "odd.toml"
    path.write_text(f'[pore]\nwidth = "100 um"\n[aggregate]\nsmooth = true\noutline = {in_um(points)}\n')
    out = ["--out", tmp_path / "run"] if command == "run" else []
    message = refusal(tmp_path, capsys, command, path, *out)
    assert needed in message and "try smooth = false" in message
    path.write_text(path.read_text().replace("true", "false"))
    assert main(["check", str(path)]) == 0


@pytest.mark.thorough
def test_check_estimates_a_large_mesh_instead_of_making_it(monkeypatch):
    """Above 20 000 nodes check estimates their number, and its report states this."""
    counts = []
    generate = mesher.generate_around

    def counted(*arguments):
        mesh, outlines = generate(*arguments)
        counts.append(len(mesh.points))
        return mesh, outlines

    monkeypatch.setattr(mesher, "generate_around", counted)
    fine = load_scene("base", ['numerics.preset="paper"', "numerics.refinement=8", "growth.end=0.2 h"])
    report = check(fine)
    assert report.estimated and f"about {report.nodes} nodes" in str(report)
    assert max(counts) < 6000 < report.nodes
    assert not check("initial_mesh").estimated
    mesh = seeded(fine).mesh
    assert report.nodes == pytest.approx(len(mesh.points), rel=0.5)
    assert report.triangles == pytest.approx(len(mesh.biomass), rel=0.5)
