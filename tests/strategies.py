"""Shapes and scenes that tests share: hypothesis strategies named after what they are, and a few fixed examples."""
import numpy as np
from hypothesis import strategies as st

from repro import geometry, growth, mesh
from repro.geometry import BOTTOM, FREE, TOP, Outline
from repro.scene import parse_scene

LENGTH = 600.0

widths = st.floats(10.0, 200.0)
lengths = st.floats(300.0, 1000.0)
refinements = st.floats(0.4, 2.0)
concentrations = st.floats(0.0, 100.0)


@st.composite
def attached_aggregates(draw, width=st.just(50.0), thinnest=0.05, thickest=0.9, uneven=0.45):
    """(Outline, width): an aggregate on the lower wall, star-shaped about the origin, that leaves a film above it."""
    width = draw(width)
    shares = draw(st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=3))
    weight = uneven / max(1.0, sum(abs(s) for s in shares))
    angle = np.linspace(0.0, np.pi, draw(st.integers(16, 48)))
    radius = 1 + weight * sum(s * np.cos((k + 1) * angle) for k, s in enumerate(shares))
    radius *= draw(st.floats(thinnest, thickest)) * width / (radius * np.sin(angle)).max()
    return _on_the_wall(radius, angle), width


def _on_the_wall(radius, angle):
    arc = radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    base = np.concatenate([np.linspace(-radius[-1], 0.0, 6), np.linspace(0.0, radius[0], 6)[1:]])
    points = np.vstack([np.column_stack([base, np.zeros(11)]), arc[1:-1]])
    wall = np.where(np.arange(len(points)) < 11, BOTTOM, FREE)
    return Outline(points, wall, np.arange(len(points)) == 5, points.copy())


def plug(width, left, right, lean=0.0):
    """A parallelogram from wall to wall, its upper side ``lean`` further downstream than its lower one."""
    middle = 0.5 * (left + right)
    points = np.array([[left, 0.0], [middle, 0.0], [right, 0.0],
                       [right + lean, width], [middle + lean, width], [left + lean, width]])
    wall, fixed = np.repeat([BOTTOM, TOP], 3), np.array([0, 1, 0, 0, 1, 0], bool)
    return Outline(points, wall, fixed, points.copy())


def mirrored(outline):
    """The image of an outline in x -> -x, still counterclockwise."""
    def back(values):
        return values[::-1].copy()

    return Outline(back(outline.points) * [-1, 1], back(outline.wall), back(outline.fixed),
                   back(outline.origin) * [-1, 1])


def meshed(outline, width=50.0, refinement=1.0, ends=None, film=2.0):
    """(PoreMesh, refined outline) with the extent of 3.1."""
    ends = geometry.meshed_extent(outline, width, LENGTH) if ends is None else ends
    return mesh.generate(outline, ends, width, refinement, film)


def relabelled(grid, biomass):
    """The same triangles with others of them as biomass: a mesh of its own, with nothing remembered of the first."""
    return mesh.PoreMesh(grid.points, grid.triangles, biomass, np.empty(0, int), grid.width, grid.ends)


def reversed_mesh(grid):
    """The image of a mesh in x -> -x."""
    return mesh.PoreMesh(grid.points * [-1, 1], grid.triangles[:, ::-1], grid.biomass, grid.loop[::-1], grid.width,
                         (-grid.ends[1], -grid.ends[0]))


def body_of(grid, outline):
    """(growth.Body, loop in its numbering): the aggregate held as 2.3.3 asks, y on the walls and x at fixed points."""
    local = np.full(len(grid.points), -1)
    local[grid.body] = np.arange(len(grid.body))
    rim = local[grid.loop]
    held = np.zeros((len(grid.body), 2), bool)
    held[rim[outline.fixed], 0] = True
    held[rim[outline.wall != FREE], 1] = True
    return growth.Body(grid.points[grid.body], local[grid.triangles[grid.biomass]], held), rim


def half_disc(radius, refinement=1.0, width=50.0):
    """(growth.Body, its loop, outline) of a half-disc on the lower wall."""
    grid, outline = meshed(geometry.seed(radius, refinement), width, refinement)
    return *body_of(grid, outline), outline


def lumped(points, triangles):
    """(N,) sum of |tau| / 3 over the triangles at each node."""
    return np.bincount(triangles.ravel(), np.repeat(mesh.triangle_areas(points, triangles) / 3, 3), len(points))


def fitted_order(sizes, errors):
    """Slope of log(error) over log(size)."""
    return np.polyfit(np.log(sizes), np.log(errors), 1)[0]


def scene(radius="5 um", width="50 um", acceptor="10 mg/L", donor="10 mg/L", velocity=None, head=None, growth=None,
          **more):
    """A scene of [pore], [aggregate], [substrates] and, where asked for, [flow] and [growth]."""
    tables = {"pore": {"width": width}, "aggregate": {"radius": radius},
              "substrates": {"acceptor": {"supply": acceptor}, "donor": {"supply": donor}}, **more}
    if velocity or head:
        tables["flow"] = {"mean_velocity": velocity} if velocity else {"head": head}
    if growth:
        tables["growth"] = growth
    return parse_scene(tables, "test", "test.toml")
