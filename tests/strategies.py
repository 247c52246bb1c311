"""Shapes and scenes that tests share: hypothesis strategies and a few fixed examples."""
import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from hypothesis import strategies as st
from skfem.quadrature import get_quadrature
from skfem.refdom import RefTri

from repro.fem import mesher, sizing
from repro.fem.mesh import Mesh
from repro.fem.outline import Outline
from repro.fem.outline import half_disc as half_disc_outline
from repro.fem.sizing import Sizing
from repro.fem.space import Space
from repro.fem.walls import BOTTOM, FREE, TOP, channel_walls
from repro.model import mechanics
from repro.model.energies import NEO_HOOKEAN
from repro.model.meshing import seeded
from repro.model.solid import material
from repro.scene import parse_scene
from repro.schemes import PAPER
from verification.problems.schemes import exchange, exchanged, load_scene

LENGTH = 600.0

widths = st.floats(10.0, 200.0)
standard = st.just(50.0)  # the width of section 4
lengths = st.floats(300.0, 1000.0)
refinements = st.floats(0.4, 2.0)
#: Orders of velocity and concentrations, and their names in scenes.
ORDERS = {1: "linear", 2: "quadratic"}
#: Presets with elements of these orders.
PRESET_OF = {1: "paper", 2: "fast"}
EVERY_ORDER = pytest.mark.parametrize("order", ORDERS)


def between(least, most):
    """Numbers with uniform logarithms from least to most; both are positive."""
    return st.floats(math.log(least), math.log(most)).map(math.exp)


concentrations = st.sampled_from([0.0, 1.0, 10.0]) | between(1e-9, 1e-2) | st.floats(0.0, 100.0)  # mg/L


@st.composite
def attached_aggregates(draw, width=standard, thinnest=0.05, thickest=0.9, uneven=0.45, geometry=1):
    """(Outline, width): an aggregate on the lower wall with a film above it, star-shaped about the origin. Its edges
    are straight (geometry 1) or arcs (2)."""
    width = draw(width)
    shares = draw(st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=3))
    weight = uneven / max(1.0, sum(abs(s) for s in shares))
    nodes = draw(st.integers(16, 48))
    angle = np.linspace(0.0, np.pi, nodes if geometry == 1 else nodes // 2 * 2 + 1)
    radius = 1 + weight * sum(s * np.cos((k + 1) * angle) for k, s in enumerate(shares))
    radius *= draw(st.floats(thinnest, thickest)) * width / (radius * np.sin(angle)).max()
    return _on_the_wall(radius, angle, geometry), width


def _on_the_wall(radius, angle, geometry):
    arc = radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    half = 5 * geometry
    right = np.linspace(0.0, radius[0], half + 1)[1:]
    base = np.concatenate([np.linspace(-radius[-1], 0.0, half + 1), right])
    points = np.vstack([np.column_stack([base, 0.0 * base]), arc[1:-1]])
    number = np.arange(len(points))
    wall = np.where(number < len(base), BOTTOM, FREE)
    return Outline(points, wall, number == half, points.copy(), geometry)


@st.composite
def outlines(draw, width=standard):
    """(Outline, width): an aggregate on the lower wall, or one from wall to wall, anywhere in the pore."""
    width = draw(width)
    left, right, lean = (draw(st.floats(*bounds)) * width for bounds in ((-1.0, -0.1), (0.1, 1.0), (-0.4, 0.4)))
    across = st.just(plug(width, left, right, lean))
    outline = draw(across | attached_aggregates(st.just(width)).map(lambda pair: pair[0]))
    room = max(0.0, 0.49 * LENGTH - np.abs(outline.points[:, 0]).max())
    points = outline.points + [draw(st.floats(-1.0, 1.0)) * room, 0.0]
    return Outline(points, outline.wall, outline.fixed, points), width


@st.composite
def scenes(draw, drives=("none", "head", "mean_velocity")):
    """A small scene: a narrow or wide pore, a seed or nearly a plug, any supply including none and any constants,
    driven by a head, by a velocity or not."""
    width, step = draw(between(10.0, 150.0)), draw(st.floats(3.0, 20.0))
    tables = {
        "pore": {"width": f"{width!r} um", "length": f"{width * draw(st.floats(4.0, 12.0))!r} um"},
        "aggregate": {"radius": f"{width * draw(st.floats(0.05, 0.95))!r} um"},
        "substrates": {name: draw(substrates()) for name in ("acceptor", "donor")},
        "kinetics": {"maximum_utilization_rate": f"{draw(between(0.5, 15.0))!r} 1/day",
                     "decay_coefficient": f"{draw(between(0.01, 1.0))!r} 1/day",
                     "degradable_fraction": draw(st.floats(0.0, 1.0)),
                     "maximum_density": f"{draw(between(1e2, 1e6))!r} mg/L"},
        "growth": {"end": f"{step * draw(st.integers(1, 2))!r} min", "time_step": f"{step!r} min"},
        "numerics": {"preset": "paper", "refinement": draw(st.floats(0.4, 0.7))},
    }
    drive = draw(st.sampled_from(drives))
    if drive != "none":
        unit = {"head": "um", "mean_velocity": "um/h"}[drive]
        tables["flow"] = {drive: f"{draw(between(1e-2, 1e5))!r} {unit}", "viscosity_ratio": draw(between(1.0, 1e4))}
    scheme = replace(PAPER, transfer=draw(st.sampled_from(["projection", "interpolation"])))
    return parse_scene(tables, "drawn", "drawn", scheme=scheme)


@st.composite
def substrates(draw):
    """Table of a substrate: supply, K_s, D in water and in the aggregate."""
    water = draw(between(0.1, 5.0))
    return {"supply": f"{draw(st.just(0.0) | between(1e-3, 50.0))!r} mg/L",
            "half_saturation": f"{draw(between(0.05, 20.0))!r} mg/L", "diffusivity": f"{water!r} cm^2/day",
            "diffusivity_in_aggregate": f"{water * draw(st.floats(0.1, 1.0))!r} cm^2/day"}


def rate_constants(scene):
    """Arguments of ``oracles.rates`` from a scene (1/h, mg/L, mg/mg)."""
    k, s = scene.kinetics, scene.substrates
    return {"half_a": s.acceptor.half_saturation, "half_d": s.donor.half_saturation, "k": k.maximum_utilization_rate,
            "Y": k.yield_coefficient, "b": k.decay_coefficient, "f_d": k.degradable_fraction,
            "d_c": k.decay_oxygen_demand, "F": k.acceptor_to_donor_ratio}


def in_um(points):
    """The points of an outline (um), as a scene has them."""
    return [[f"{float(x)!r} um", f"{float(y)!r} um"] for x, y in points]


def number(text):
    """The number of a text such as "50 um"."""
    return float(text.split()[0])


def plug(width, left, right, lean=0.0):
    """A parallelogram from wall to wall. Its upper side lies ``lean`` downstream of its lower side."""
    middle = 0.5 * (left + right)
    points = np.array([[left, 0.0], [middle, 0.0], [right, 0.0],
                       [right + lean, width], [middle + lean, width], [left + lean, width]])
    wall, fixed = np.repeat([BOTTOM, TOP], 3), np.array([0, 1, 0, 0, 1, 0], bool)
    return Outline(points, wall, fixed, points.copy())


def mirrored(outline):
    """Mirror an outline in x -> -x. The result is counterclockwise and begins with a corner."""
    def back(values):
        return np.roll(values[::-1], 1 - outline.geometry, axis=0)

    return Outline(back(outline.points) * [-1, 1], back(outline.wall), back(outline.fixed),
                   back(outline.origin) * [-1, 1], outline.geometry, _mirrored_seat(outline.seat))


def _mirrored_seat(seat):
    """The seat of an aggregate whose pore is mirrored in x -> -x."""
    return replace(seat, middle=None if seat.middle is None else -seat.middle)


def mirror_image(at, along):
    """The mirror image of a pore: x -> -x if ``along``, else y -> W - y. Nodes keep their numbers."""
    mesh = at.mesh
    about, sign = ([0.0, 0.0], [-1, 1]) if along else ([0.0, mesh.width], [1, -1])
    turned = [0, 2, 1, 5, 4, 3][: mesh.cells.shape[1]]
    ends = tuple(-x for x in mesh.ends[::-1]) if along else mesh.ends

    def back(values):
        return np.roll(values[::-1], 1 - mesh.geometry)

    def exchanged(values):
        """Values at quadrature points, which are those of a triangle with two corners exchanged."""
        rules = (get_quadrature(RefTri, degree)[0].T for degree in range(2, 20))
        points = next((rule for rule in rules if len(rule) == values.shape[1]), np.zeros((1, 2)))
        return values[:, [int(np.abs(points - point[::-1]).sum(axis=1).argmin()) for point in points]]

    image = Mesh.of(about + mesh.points * sign, mesh.cells[:, turned], mesh.biomass, (back(mesh.loop),), mesh.walls,
                    ends, mesh.topology.method)
    space = Space(image)
    walls = {FREE: FREE, BOTTOM: BOTTOM if along else TOP, TOP: TOP if along else BOTTOM}
    body, (region,) = at.body, image.regions
    body = replace(body, wall=np.array([walls[wall] for wall in back(body.wall).tolist()]), fixed=back(body.fixed),
                   active=exchanged(body.active), inert=exchanged(body.inert), theta=exchanged(body.theta),
                   solid=material(space, region, about + body.reference * sign, body.solid.energy),
                   configuration=body.configuration.carried(lambda positions: about + positions * sign),
                   line_speeds=None,
                   seat=_mirrored_seat(body.seat) if along else replace(body.seat, wall=walls[body.seat.wall]))
    return replace(at, space=space, bodies=(body,))


#: Mirror images of a pore: along the flow, and across it.
MIRRORS = {"along": partial(mirror_image, along=True), "across": partial(mirror_image, along=False)}


def seed(radius, refinement=1.0, geometry=1):
    """Outline of a half-disc with as many elements across as in a scene."""
    return half_disc_outline(radius, sizing.ACROSS_AGGREGATE * refinement, geometry)


def meshed(around, width=50.0, refinement=1.0, ends=None, film=2.0):
    """(Mesh, refined outline) with the extent of 3.1; straight or curved like the outline."""
    ends = sizing.meshed_extent(around, width, LENGTH) if ends is None else ends
    sizes = Sizing(channel_walls(width), refinement, film)
    if around is None:
        return mesher.generate_around([], ends, sizes)[0], None
    mesh, (refined,) = mesher.generate_around([around], ends, sizes, around.geometry)
    return mesh, refined


def bent_inside(grid, by=0.2):
    """Move the mid-edge nodes of inner edges of a curved mesh by up to ``by`` um; no element turns over."""
    points, random = grid.points.copy(), np.random.default_rng(1)
    dofs = grid.topology.dofs
    outer = np.concatenate([dofs.inlet.ravel(), dofs.outlet.ravel(), dofs.walls, grid.loop])
    inner = np.setdiff1d(np.arange(grid.corners, len(points)), outer)
    points[inner] += random.uniform(-by, by, (len(inner), 2))
    return grid.moved(points).checked()


def boundary_edge_counts(triangles):
    """Number of boundary edges of each triangle, sorted."""
    edges = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2))
    _, edge_index, count = np.unique(edges, axis=0, return_inverse=True, return_counts=True)
    return sorted((count[edge_index] == 1).reshape(-1, 3).sum(axis=1))


def body_of(grid, around):
    """(Solid, constrained (n, 2), rim (M,)): the unstrained aggregate, its constrained dofs (2.3.3: y on the
    walls and x at fixed points) and its boundary nodes."""
    body = material(Space(grid), grid.regions[0], grid.points[grid.body], NEO_HOOKEAN)
    rim = grid.regions[0].own_loop
    return body, mechanics.constrained(len(grid.body), rim, around.wall, around.fixed), rim


def half_disc(radius, refinement=1.0, width=50.0, geometry=1):
    """(Solid, constrained, rim, outline) of a half-disc on the lower wall."""
    grid, around = meshed(seed(radius, refinement, geometry), width, refinement)
    return *body_of(grid, around), around


def same_arrays(one, other):
    """Return whether two tables have the same names and bitwise equal arrays."""
    return one.keys() == other.keys() and all(np.array_equal(one[name], other[name], equal_nan=True) for name in one)


def arrays_of(grid):
    """{name: array} of a grid: points, cells, point data and cell data."""
    return {"points": grid.points, "cells": grid.cells, **grid.point_data, **grid.cell_data}


def scene(radius="5 um", width="50 um", acceptor="10 mg/L", donor="10 mg/L", velocity=None, head=None, growth=None,
          order=None, **more):
    """A scene with [pore], [aggregate], [substrates] and, optionally, [flow] and [growth]. order: of the elements, by
    default that of the preset."""
    tables = {"pore": {"width": width}, "aggregate": {"radius": radius},
              "substrates": {"acceptor": {"supply": acceptor}, "donor": {"supply": donor}}, **more}
    if velocity or head:
        tables["flow"] = {"mean_velocity": velocity} if velocity else {"head": head}
    if growth:
        tables["growth"] = growth
    tables["numerics"] = {"preset": "paper", **tables.get("numerics", {})}
    plain = parse_scene(tables, "test", "test.toml")
    return exchanged(plain, exchange(elements=ORDERS[order])) if order else plain


def coarse_base(order, *changes, unset=()):
    """(scene, its seed): base with coarse elements of an order, and supplies that differ."""
    scene = load_scene("base", ['substrates.acceptor.supply="9 mg/L"', 'substrates.donor.supply="4 mg/L"',
                                "numerics.refinement=0.3", exchange(elements=ORDERS[order]), *changes], unset=unset)
    return scene, seeded(scene)
