"""Every column and array, derived from the raw state by formulas and quadratures independent of `repro.results`. The
pore is asymmetric and plugged by the aggregate, so no two quantities are alike."""
import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from skfem import ElementTriP1, ElementTriP2
from skfem.quadrature import get_quadrature
from skfem.refdom import RefTri

from repro import results
from repro.march.simulation import simulate
from repro.model import adhesion, solving, traction
from repro.report import quantities
from repro.report.reading import Run
from repro.results.names import KNOWN
from tests import oracles
from tests.pages import AXES, CHARTS, LEDGERS
from tests.strategies import EVERY_ORDER, MIRRORS, ORDERS, arrays_of, rate_constants
from verification.problems.schemes import exchange, load_scene

#: An outline that leans upstream and touches the upper wall of a pore of 20 um after some minutes.
SHAPE = [(-21, 0), (-19, 9), (-12, 17), (-4, 19.2), (3, 18.6), (12, 12), (16, 5), (17, 0)]
SETS = [exchange(steps="midpoint"), 'pore.width="20 um"', 'pore.length="400 um"', 'growth.end="1.2 h"',
        'output.times=["0 h", "1.2 h"]', 'substrates.acceptor.supply="9 mg/L"', 'substrates.donor.supply="4 mg/L"',
        'growth.shear_modulus="0.003 MPa"', "aggregate.inert_fraction=0.2"]


#: An outline that touches both walls at t = 0.
SPANNING = [(-21, 0), (-19, 9), (-9, 20), (3, 20), (12, 12), (16, 5), (17, 0)]


def drawn(order):
    return load_scene("base", [exchange(elements=ORDERS[order]),
                               f"numerics.refinement={0.7 if order == 1 else 0.2}", *SETS])


@cache
def late_instant(order):
    """(scene, Report) after several steps, a new mesh and contact."""
    *_, last = simulate(drawn(order), shape=SHAPE)
    assert last.pore.contact and last.remeshes and len(last.ledgers) > 1, "otherwise the tests would show little"
    return drawn(order), last


#: States in which every column and array is derived: the first row, and the late state, its mirror image and the late
#: state upside down, solved in either form of the interface.
STATES = {"first": ("first", "traction"), "late": ("late", "laplacian"), "mirrored": ("along", "laplacian"),
          "upside down": ("across", "traction")}
EVERY_STATE = pytest.mark.parametrize("state", STATES)


@cache
def instant_in(state, order):
    """(scene, Report) of one of STATES."""
    image, form = STATES[state]
    scene, report = late_instant(order)
    scene = replace(scene, numerics=replace(scene.numerics, interface=form))
    if image == "first":
        return scene, next(simulate(scene, shape=SPANNING))
    if state == "late":
        return scene, report
    at = MIRRORS[image](report.pore)
    return scene, replace(report, pore=at, solved=solving.solve(scene, at))


#: Nodes of the functions of an order on the unit triangle.
CORNERS = [(0, 0), (1, 0), (0, 1)]
NODES = {1: np.array(CORNERS, float), 2: np.array([*CORNERS, (0.5, 0), (0.5, 0.5), (0, 0.5)])}
ELEMENTS = {1: ElementTriP1(), 2: ElementTriP2()}


def functions(order, places):
    """(q, k) values and (q, k, 2) derivatives at points (q, 2) of the unit triangle, by scikit-fem."""
    at = np.asarray(places, float).T
    values, slopes = zip(*(ELEMENTS[order].lbasis(at, k) for k in range(len(NODES[order]))))
    return np.stack(values, axis=-1), np.moveaxis(slopes, 0, 1).T


def jacobians(points, cells, places):
    """(t, q, 2, 2) derivatives of x by the coordinates of the unit triangle."""
    return np.einsum("tai,qaj->tqij", points[cells], functions({3: 1, 6: 2}[cells.shape[1]], places)[1])


def gradients(order, points, cells, places):
    """(t, q, k, 2) gradients of the functions of an order, and (t, q) determinants of the triangles' maps."""
    J = jacobians(points, cells, places)
    return np.einsum("qkj,tqji->tqki", functions(order, places)[1], np.linalg.inv(J)), np.linalg.det(J)


def rule(degree):
    """(q, 2) points and (q,) weights of scikit-fem's quadrature."""
    places, weights = get_quadrature(RefTri, degree)
    return places.T, weights


def node_coordinates(space):
    """(n, 2) coordinates (um) of the nodes of a space."""
    coordinates = np.empty((space.cells.max() + 1, 2))
    values = functions(space.mesh.geometry, NODES[space.order])[0]
    coordinates[space.cells] = np.einsum("ka,tai->tki", values, space.mesh.points[space.mesh.cells])
    return coordinates


def integrate_over_end(space, x, *fields):
    """Integrate the product of nodal fields over an end of the meshed part, edge by edge."""
    place = node_coordinates(space)
    nodes = np.flatnonzero(np.abs(place[:, 0] - x) < 1e-9)
    nodes = nodes[np.argsort(place[nodes, 1])]
    points, weights = np.polynomial.legendre.leggauss(6)
    knots, total = np.linspace(-1, 1, space.order + 1), 0.0
    for k in range(0, len(nodes) - 1, space.order):
        edge = nodes[k: k + space.order + 1]
        product = math.prod(np.polyval(np.polyfit(knots, field[edge], space.order), points) for field in fields)
        total += (place[edge[-1], 1] - place[edge[0], 1]) / 2 * weights @ product
    return total


def rate_of(scene, gradient):
    """The rate that the viscosity multiplies in the form of a scene, from (..., 2, 2) grad u [E2]."""
    return gradient + np.swapaxes(gradient, -1, -2) * (scene.numerics.interface == "traction")


def pressure_drop(scene, pore, flow):
    """Head loss (um) over the meshed part. Linear elements: the difference of the ends' mean heads. Quadratic elements:
    the viscous work, nu / g times the integral of nu_r grad u : (grad u [+ grad u^T]), over the flow."""
    space = pore.space
    if space.order == 1:
        first, last = (integrate_over_end(space, x, flow.head) / scene.pore.width for x in pore.mesh.ends)
        return first - last
    places, weights = rule(space.gradient_degree)
    slopes, determinants = gradients(space.order, pore.mesh.points, pore.mesh.cells, places)
    gradient = np.einsum("tkc,tqki->tqci", flow.velocity[space.cells], slopes)
    thick = np.where(pore.mesh.biomass, scene.flow.viscosity_ratio, 1.0)
    work = np.einsum("t,tq,q,tqci->", thick, determinants, weights, gradient * rate_of(scene, gradient))
    through = integrate_over_end(space, pore.mesh.ends[0], flow.velocity[:, 0])
    return scene.flow.kinematic_viscosity / scene.flow.gravity * work / through


def arcs(pore):
    """(k, 2) points along the aggregate's boundary, dense enough on each arc to find its extremes to 1e-6."""
    loop = pore.mesh.loop
    if pore.mesh.geometry == 1:
        return pore.mesh.points[loop]
    t = np.linspace(0, 1, 2001)
    along = np.column_stack([(1 - t) * (1 - 2 * t), 4 * t * (1 - t), t * (2 * t - 1)])
    ends_and_middles = np.column_stack([loop[::2], loop[1::2], np.roll(loop[::2], -1)])
    return (along @ pore.mesh.points[ends_and_middles]).reshape(-1, 2)


def total_uptake(scene, pore, state):
    """(2,) uptake of acceptor and donor (um2 mg/L/h) from (7) and (8) as printed."""
    return -total_rates(scene, pore, state)[:2]


def total_rates(scene, pore, state):
    """(4,) F1 to F4 (um2 mg/L/h), the rates (7)-(10) as printed, of all biomass."""
    pieces, total = pore.space.reaction, np.zeros(4)
    for nodes, masses in zip(pieces.cells, pore.active):
        for N, X in zip(pieces.values, masses):
            known = (max(N @ field[nodes], 0.0) for field in (state.acceptor, state.donor))
            rates = oracles.rates(*known, **rate_constants(scene))
            total += X * np.array(rates)
    return total


def derived_row(scene, instant):
    """{column: value} for an instant."""
    pore, flow = instant.pore, instant.solved.flow
    state = instant.solved.concentrations
    W, L = scene.pore.width, scene.pore.length
    (first, last), u_x = pore.mesh.ends, flow.velocity[:, 0]
    flux = integrate_over_end(pore.space, last, u_x)
    nu = scene.flow.kinematic_viscosity / scene.flow.gravity
    loss = pressure_drop(scene, pore, flow) + 12 * nu * flux / W**3 * (L - (last - first))
    derived = {"time_h": pore.time, "mean_velocity_m_per_d": flux / W * 24 / 1e6, "head_loss_cm": loss / 1e4,
             "conductivity_m_per_d": flux / W * L / loss * 24 / 1e6, "meshed_length_um": last - first,
             "nodes": len(set(pore.mesh.cells.ravel().tolist())), "remeshed": int(pore.time > 0), "contact": 1}
    uptake = total_uptake(scene, pore, state)
    for k, (name, field) in enumerate((("acceptor", state.acceptor), ("donor", state.donor))):
        derived[f"effluent_{name}_mg_per_L"] = integrate_over_end(pore.space, last, u_x, field) / flux
        inflow = integrate_over_end(pore.space, first, u_x)
        derived[f"inlet_{name}_mg_per_L"] = integrate_over_end(pore.space, first, u_x, field) / inflow
        derived[f"{name}_min_mg_per_L"] = min(field.tolist())
        above = (value - getattr(scene.substrates, name).supply for value in field.tolist())
        derived[f"{name}_overshoot_mg_per_L"] = max(0.0, *above)
        supplied = getattr(scene.substrates, name).supply * inflow
        assert abs(supplied - integrate_over_end(pore.space, last, u_x, field) - uptake[k]) <= 1e-9 * supplied
        derived[f"{name}_balance"] = 0.0
        derived[f"{name}_uptake_ug_per_m_per_h"] = 1e-6 * uptake[k]
    derived["biomass_growth_ug_per_m_per_h"] = 1e-6 * total_rates(scene, pore, state)[2:].sum()
    x, y = arcs(pore).T
    at_points, weights = rule(8)
    body = pore.mesh.cells[pore.mesh.biomass]
    derived["aggregate_area_um2"] = (np.linalg.det(jacobians(pore.mesh.points, body, at_points)) @ weights).sum()
    derived |= {"thickness_um": y.max(), "upstream_um": x.min(), "downstream_um": x.max()}
    density = (pore.active + pore.inert).sum(1) / areas_at_points(pore).sum(1) / scene.kinetics.maximum_density
    derived |= {"inert_fraction": pore.inert.sum() / (pore.active.sum() + pore.inert.sum()),
              "biomass_density_min": density.min(), "biomass_density_max": density.max(),
              "biomass_balance": 0.0, "oxygen_demand_balance": 0.0}
    away = []
    for part in free_surfaces(pore):
        walked = np.cumsum([0.0, *(chord(pore, *edge) for edge in part)])
        middles = (walked[1:] + walked[:-1]) / 2
        far = np.minimum(middles, walked[-1] - middles) > 0.05 * walked[-1]
        away += [along_edge(pore, *edge)[:2] for edge, counts in zip(part, far) if counts]
    stretch, place = zip(*away)
    x, y = place[int(np.argmin(stretch))]
    derived |= {"surface_stretch_min": min(stretch), "surface_stretch_min_x_um": x, "surface_stretch_min_y_um": y}
    return derived


#: Columns that a scene must ask for: `derived_adhesion` and `derived_wall_traction` derive those of the same state.
ASKED = {*(f"{name}_max_{part}" for name in ("wall_traction", "tensile_stress") for part in ("MPa", "x_um", "y_um")),
         "fluid_force_x_uN_per_m", "fluid_force_y_uN_per_m", "fluid_moment_nN"}


def chord(pore, a, b):
    return math.dist(pore.mesh.points[a], pore.mesh.points[b])


def free_surfaces(pore):
    """Lists of edges (corner, corner) from one contact line to the next. An edge is in contact if all of its nodes lie
    on one wall."""
    nodes = pore.mesh.loop.tolist()
    step = pore.mesh.geometry
    closed = [*nodes, nodes[0]]
    edges = [closed[k: k + step + 1] for k in range(0, len(nodes), step)]
    heights = [pore.mesh.points[edge, 1] for edge in edges]
    in_contact = [bool((y == 0.0).all() or (y == pore.mesh.width).all()) for y in heights]
    first = in_contact.index(True)
    parts = [[]]
    for edge, on in zip(edges[first:] + edges[:first], in_contact[first:] + in_contact[:first]):
        if on:
            parts.append([])
        else:
            parts[-1].append((edge[0], edge[-1]))
    return [part for part in parts if part]


def along_edge(pore, a, b):
    """|F T| / J^(1/2) at the middle of the edge a-b, with its tangent T at t = 0; the point and its triangle."""
    (triangle,) = [k for k in np.flatnonzero(pore.mesh.biomass) if {a, b} <= set(pore.mesh.cells[k, :3].tolist())]
    nodes = pore.mesh.cells[triangle]
    ends = [NODES[1][nodes.tolist().index(node)] for node in (a, b)]
    middle = np.mean(ends, axis=0)[None]
    inside = np.searchsorted(pore.mesh.body, nodes)[None]
    before = jacobians(pore.body.reference, inside, middle)[0, 0]
    F = jacobians(pore.mesh.points, nodes[None], middle)[0, 0] @ np.linalg.inv(before)
    T = before @ (ends[1] - ends[0])
    place = (functions(pore.mesh.geometry, middle)[0] @ pore.mesh.points[nodes])[0]
    return np.linalg.norm(F @ T) / np.linalg.norm(T) / math.sqrt(np.linalg.det(F)), place, triangle


def areas_at_points(pore):
    """(r, q) areas (um2) of the reaction points: a third of the triangles around a node, or the quadrature weight."""
    body = pore.mesh.cells[pore.mesh.biomass]
    if pore.space.order == 1:
        third = np.repeat(np.linalg.det(jacobians(pore.mesh.points, body, [(0, 0)]))[:, 0] / 6, 3)
        return np.bincount(body.ravel(), third)[np.unique(body), None]
    places, weights = rule_with(pore.active.shape[1])
    return np.linalg.det(jacobians(pore.mesh.points, body, places)) * weights


def rule_with(points):
    """Return the quadrature with this number of points."""
    if points == 1:
        return np.array([[1 / 3, 1 / 3]]), np.array([0.5])
    return next(candidate for candidate in map(rule, range(20)) if len(candidate[1]) == points)


@EVERY_STATE
@EVERY_ORDER
def test_every_column_is_what_its_name_says(order, state):
    """Flow-weighted concentrations and coordinates agree to 1e-6 (arcs are sampled), balances to 1e-6, the tolerance of
    a run, and the rest to round-off. Heads depend on the linear system, whose defect is 1e-10. In the first row all
    stretches are 1, so that any free edge may be the place of the least one."""
    scene, instant = instant_in(state, order)
    row, expected = results.row(scene, instant), derived_row(scene, instant)
    if state == "first":
        edges = [edge for part in free_surfaces(instant.pore) for edge in part]
        places = [along_edge(instant.pore, *edge)[1] for edge in edges]
        place = [row[f"surface_stretch_min_{axis}_um"] for axis in "xy"]
        assert min(math.dist(place, each) for each in places) < 1e-9
        expected |= {f"surface_stretch_min_{axis}_um": value for axis, value in zip("xy", place)}
    assert {name for name, value in row.items() if value is None} == ASKED
    row = {name: value for name, value in row.items() if value is not None}
    assert row.keys() == expected.keys()
    for name, value in expected.items():
        tight = name in ("time_h", "nodes", "remeshed", "contact", "inert_fraction", "aggregate_area_um2")
        assert row[name] == pytest.approx(value, rel=1e-12 if tight else 1e-6,
                                          abs=1e-6 if name.endswith("_balance") else 1e-12), name
        assert KNOWN[name].signed or row[name] >= 0, name
    assert row["head_loss_cm"] == pytest.approx(scene.flow.head / 1e4, rel=1e-9)
    values = [value for name, value in row.items() if not name.endswith(("_balance", "_overshoot_mg_per_L"))]
    alike = len(values) - len(set(values))
    assert state != "late" or alike == 1, "two columns alike would hide an exchange (remeshed and contact are)"


def stresses(scene, pore):
    """At the points of theta: Cauchy stress (t, q, 3, 3) MPa of the aggregate, J (t, q), and areas (t, q) um2 at t = 0.
    """
    mesh = pore.mesh
    cells = mesh.cells[mesh.biomass]
    places, weights = rule_with(pore.body.theta.shape[1])
    before = jacobians(pore.body.reference, np.searchsorted(mesh.body, cells), places)
    F = np.zeros((*before.shape[:2], 3, 3))
    F[..., :2, :2], F[..., 2, 2] = jacobians(mesh.points, cells, places) @ np.linalg.inv(before), 1.0
    P = pore.pressure[cells[:, :3]] @ functions(1, places)[0].T
    return scene.growth.shear_modulus * cauchy(F, P), np.linalg.det(F), np.linalg.det(before) * weights


def nodal_loads(mesh, cells, places, sigma, areas):
    """(N, 2) sums of sigma grad N_i over the areas of points."""
    slopes, _ = gradients(mesh.geometry, mesh.points, cells, places)
    loads = np.zeros_like(mesh.points)
    np.add.at(loads, cells, np.einsum("tq,tqij,tqkj->tki", areas, sigma, slopes))
    return loads


def water_loads(scene, instant):
    """(N, 2) MPa um, forces of the water on the nodes: its stress rho (nu grad u [+ grad u^T] - g phi) in its
    triangles. At a contact line, the pressure on the edge of the wall beside it acts on the wall."""
    pore, flow = instant.pore, instant.solved.flow
    mesh, space, drive = pore.mesh, pore.space, scene.flow
    wet = ~mesh.biomass
    cells = mesh.cells[wet]
    places, weights = rule(8)
    slopes, determinants = gradients(space.order, mesh.points, cells, places)
    grad = np.einsum("tkc,tqki->tqci", flow.velocity[space.cells[wet]], slopes)
    corners_of = mesh.cells[:, :3][wet]
    head = flow.head[corners_of] @ functions(1, places)[0].T
    stress = drive.kinematic_viscosity / drive.gravity * rate_of(scene, grad) - head[..., None, None] * np.eye(2)
    loads = -nodal_loads(mesh, cells, places, stress, determinants * weights)
    body = set(mesh.body.tolist())
    s, gauss = np.polynomial.legendre.leggauss(6)
    for triangle, corners in zip(cells, corners_of):
        for k in range(3):
            a, b = triangle[k], triangle[(k + 1) % 3]
            y = mesh.points[[a, b], 1]
            on_wall = (y == 0.0).all() or (y == mesh.width).all()
            if on_wall and (a in body) != (b in body):
                along = [NODES[1][k] + (NODES[1][(k + 1) % 3] - NODES[1][k]) * (1 + t) / 2 for t in s]
                inside = functions(1, along)[0] @ flow.head[corners]
                values = functions(mesh.geometry, along)[0]
                half = abs(mesh.points[a, 0] - mesh.points[b, 0]) / 2
                node = 0 if a in body else 1
                shape = values[:, k if node == 0 else (k + 1) % 3]
                loads[(a, b)[node], 1] += (1 if y[0] == 0.0 else -1) * half * gauss @ (inside * shape)
    return 1e-12 * drive.density * drive.gravity * 1e-3 * 1e-6 / 3600**2 * loads


def derived_adhesion(scene, instant):
    """{column: value} of the columns of adhesion. `derived_wall_traction` derives those of the wall's traction."""
    pore = instant.pore
    mesh = pore.mesh
    sigma, J, initial_areas = stresses(scene, pore)
    areas = J * initial_areas
    cells = mesh.cells[mesh.biomass]
    shapes = functions(mesh.geometry, rule_with(pore.body.theta.shape[1])[0])[0]
    places = np.einsum("qk,tki->tqi", shapes, mesh.points[cells]).reshape(-1, 2)
    of_body = mesh.points[mesh.body]
    distances = np.linalg.norm(of_body[:, None] - places, axis=-1)
    weights = np.maximum(1 - (distances / (mesh.width / 20)) ** 2, 0) * areas.ravel()
    near = weights.any(axis=1)
    means = weights[near] @ sigma.reshape(-1, 9) / weights[near].sum(axis=1)[:, None]
    largest = np.linalg.eigvalsh(means.reshape(-1, 3, 3))[:, -1]
    x, y = of_body[near][largest.argmax()]
    loads = water_loads(scene, instant)[mesh.body]
    seat = mesh.width if pore.body.reference[:, 1].min() > 0 else 0.0
    on = of_body[of_body[:, 1] == seat, 0]
    arm = of_body - [(on.min() + on.max()) / 2, seat]
    force = loads.sum(axis=0)
    return {"tensile_stress_max_MPa": largest.max(), "tensile_stress_max_x_um": x, "tensile_stress_max_y_um": y,
            "fluid_force_x_uN_per_m": 1e6 * force[0], "fluid_force_y_uN_per_m": 1e6 * force[1],
            "fluid_moment_nN": 1e3 * (arm[:, 0] * loads[:, 1] - arm[:, 1] * loads[:, 0]).sum()}


#: Keys of [growth]: the walls bear the stress alone, or the forces of the water, too.
BEARING = {"stress": {}, "water": {"fluid_forces": "included"}}


def bearing(scene, changes):
    """The scene with columns of adhesion, in water that is 1e5 times as dense, so that its forces count."""
    drive = replace(scene.flow, density=1e5 * scene.flow.density)
    return replace(scene, flow=drive, growth=replace(scene.growth, tensile_strength=1e3, **changes))


@pytest.fixture
def as_it_is(monkeypatch):
    """Stresses are those of a state, not of the equilibrium near it; the states here are not in equilibrium."""
    monkeypatch.setattr(adhesion, "at_rest", lambda loading, pore, solved: (pore, solved))


@EVERY_STATE
@EVERY_ORDER
def test_the_columns_of_adhesion_are_what_their_names_say(order, state, as_it_is):
    """A strength that is never reached adds the columns to a state and changes nothing else. They agree to 1e-6, forces
    and moments to that of the largest. The body of the first row has no stress, so that its place is any node."""
    scene, instant = instant_in(state, order)
    growth = replace(scene.growth, tensile_strength=1e3)
    row = results.row(replace(scene, growth=growth), instant)
    expected = derived_adhesion(scene, instant)
    assert {*expected, *(f"wall_traction_max_{part}" for part in ("MPa", "x_um", "y_um"))} == ASKED
    if state == "first":
        assert abs(row["tensile_stress_max_MPa"]) < 1e-12 * scene.growth.shear_modulus
        expected = {name: value for name, value in expected.items() if name.startswith("fluid")}
    largest = max(abs(value) for name, value in expected.items() if name.startswith("fluid"))
    for name, value in expected.items():
        assert row[name] == pytest.approx(value, rel=1e-6, abs=1e-9 * largest), name


@pytest.mark.parametrize("state", ["first", "late", "upside down"])
@EVERY_ORDER
def test_the_water_pushes_a_shape_by_its_stress(order, state):
    """In both forms of the interface, at all nodes beside the walls. At contact lines the columns alone take off the
    force on the wall."""
    scene, instant = instant_in(state, order)
    scene, pore = bearing(scene, BEARING["water"]), instant.pore
    fluid = traction.Fluid.of(scene)
    forces = traction.forces(fluid, traction.surroundings(fluid.meshing, pore, pore), pore)
    expected = water_loads(scene, instant)[pore.mesh.body] / scene.growth.shear_modulus
    y = pore.mesh.points[pore.mesh.body, 1]
    free = (y > 0.0) & (y < pore.mesh.width)
    assert forces[free] == pytest.approx(expected[free], abs=1e-7 * np.abs(expected).max())


def edges_on_wall(mesh, height):
    """(e, 2 or 3) nodes of the aggregate's edges on the wall at this y, from the smallest x on."""
    step = mesh.geometry
    closed = [*mesh.loop.tolist(), int(mesh.loop[0])]
    edges = [closed[k: k + step + 1] for k in range(0, len(closed) - 1, step)]
    touching = [edge for edge in edges if (mesh.points[edge, 1] == height).all()]
    along = [edge if mesh.points[edge[0], 0] < mesh.points[edge[-1], 0] else edge[::-1] for edge in touching]
    return sorted(along, key=lambda edge: mesh.points[edge[0], 0])


def lagrange(count):
    """Lagrange's polynomials of `count` evenly spaced nodes in [0, 1]."""
    at = np.linspace(0, 1, count)
    fitted = [np.polyfit(at, row, count - 1) for row in np.eye(count)]
    return [np.polynomial.Polynomial(coefficients[::-1]) for coefficients in fitted]


def traction_integral(mesh, edges, forces):
    """(x, T): places (um) along a wall, and the integral (MPa um) up to there of the traction whose consistent nodal
    forces are ``forces`` (N,). Polynomials are integrated exactly on each edge."""
    shapes = lagrange(len(edges[0]))
    nodes = sorted({node for edge in edges for node in edge})
    paths = [sum(mesh.points[node, 0] * shape for node, shape in zip(edge, shapes)) for edge in edges]
    mass = np.zeros((len(nodes), len(nodes)))
    for edge, path in zip(edges, paths):
        rows = [nodes.index(node) for node in edge]
        mass[np.ix_(rows, rows)] += [[(a * b * path.deriv()).integ()(1) for b in shapes] for a in shapes]
    density = dict(zip(nodes, np.linalg.solve(mass, forces[nodes])))
    s, x, T = np.linspace(0, 1, 4001), [], [np.zeros(1)]
    for edge, path in zip(edges, paths):
        along = (sum(density[node] * shape for node, shape in zip(edge, shapes)) * path.deriv()).integ()
        x.append(path(s))
        T.append(T[-1][-1] + along(s))
    return np.concatenate(x), np.concatenate(T[1:])


def traction_peak(mesh, height, forces):
    """(value, x) of the largest mean over W / 20 of (max(pull, 0)^2 + shear^2)^(1/2), in MPa and um, on one wall."""
    edges = edges_on_wall(mesh, height)
    x, T = traction_integral(mesh, edges, (-1 if height == 0.0 else 1) * forces[:, 1])
    length = min(mesh.width / 20, x[-1] - x[0])
    nodes = sorted({node for edge in edges for node in edge})
    places = mesh.points[nodes, 0]
    starts = np.unique(np.concatenate([x, x - length, places, places - length]))
    starts = starts[(starts >= x[0] - 1e-9) & (starts <= x[-1] - length + 1e-9)]
    pull = np.interp(starts + length, x, T) - np.interp(starts, x, T)
    x, T = traction_integral(mesh, edges, forces[:, 0])
    shear = np.interp(starts + length, x, T) - np.interp(starts, x, T)
    bears = np.hypot(np.maximum(pull, 0), shear) / length
    return bears.max(), starts[bears.argmax()] + length / 2


def derived_wall_traction(scene, instant):
    """(value, x, y) of the largest mean traction that a wall must bear, in MPa and um: the stress of the aggregate,
    tested with the nodal functions, less the forces of the water if the growth problem has them."""
    mesh = instant.pore.mesh
    cells = mesh.cells[mesh.biomass]
    places, _ = rule_with(instant.pore.body.theta.shape[1])
    sigma, J, areas = stresses(scene, instant.pore)
    forces = nodal_loads(mesh, cells, places, sigma[..., :2, :2], J * areas)
    if scene.growth.fluid_forces == "included":
        forces = forces - water_loads(scene, instant)
    return max((*traction_peak(mesh, height, forces), height) for height in (0.0, mesh.width))


@pytest.mark.parametrize("state, parts, bears", [
    *(("late", 2048, bears) for bears in BEARING),
    *((state, 64, "water") for state in STATES if state != "late")])
@EVERY_ORDER
def test_the_columns_of_the_wall_traction_are_what_their_names_say(order, state, parts, bears, monkeypatch, as_it_is):
    """The columns try the means that start or end at each part of an edge on the wall. These miss the largest mean by
    h / (2 length) / parts^2, relative, for an edge h, and its place by two parts. The state was computed without the
    water's forces. The columns take the forces of the walls from the stress and the water alone. In the first row there
    is no stress, so that the water alone pulls. Where theta is J, the stabilisation bears no load."""
    monkeypatch.setattr(adhesion, "PARTS", parts)
    scene, instant = instant_in(state, order)
    _, J, _ = stresses(scene, instant.pore)
    instant = replace(instant, pore=instant.pore.with_body(theta=J))
    mesh = instant.pore.mesh
    scene = bearing(scene, BEARING[bears])
    row = results.row(scene, instant)
    value, x, y = derived_wall_traction(scene, instant)
    longest = max(np.ptp(mesh.points[edge, 0]) for height in (0.0, mesh.width) for edge in edges_on_wall(mesh, height))
    bound = longest / (2 * mesh.width / 20) / parts**2
    assert row["wall_traction_max_MPa"] == pytest.approx(value, rel=max(bound, 1e-6))
    assert row["wall_traction_max_x_um"] == pytest.approx(x, abs=2 * longest / parts + 1e-6)
    assert row["wall_traction_max_y_um"] == y


def derived_arrays(scene, instant):
    """{array: values} for an instant."""
    pore, flow = instant.pore, instant.solved.flow
    state = instant.solved.concentrations
    mesh, body = pore.mesh, pore.body
    inside = sorted(set(mesh.cells[mesh.biomass].ravel().tolist()))

    def at_nodes(field, order=pore.space.order, cells=pore.space.cells):
        values, basis = np.empty((len(mesh.points), *field.shape[1:])), functions(order, NODES[mesh.geometry])[0]
        values[mesh.cells] = np.einsum("ak,tk...->ta...", basis, field[cells])
        return values

    def only(values, where, count):
        everywhere = np.full((count, *values.shape[1:]), np.nan)
        everywhere[where] = values
        return everywhere

    def plane(vectors):
        return np.column_stack([vectors, np.where(np.isnan(vectors[:, 0]), np.nan, 0.0)])

    derived = {"velocity_m_per_d": plane(at_nodes(flow.velocity)) * 24 / 1e6,
             "head_cm": at_nodes(flow.head, 1, mesh.cells[:, :3]) / 1e4,
             "acceptor_mg_per_L": at_nodes(state.acceptor), "donor_mg_per_L": at_nodes(state.donor),
             "displacement_um": plane(only(mesh.points[inside] - body.reference, inside, len(mesh.points))),
             "position_t0_um": plane(only(body.reference, inside, len(mesh.points))),
             "region": mesh.biomass.astype(float)}
    for name in ("active", "inert"):
        derived[f"{name}_biomass"] = density_at_nodes(pore, getattr(pore, name)) / scene.kinetics.maximum_density
    pressure = scene.growth.shear_modulus * at_nodes(pore.pressure, 1, mesh.cells[:, :3])
    derived["pressure_MPa"] = only(pressure[inside], inside, len(mesh.points))
    sigma, J, areas = stresses(scene, pore)
    means = {"theta": pore.body.theta, "J": J,
             "largest_principal_stress_MPa": np.linalg.eigvalsh(sigma)[..., -1]}
    for name, (i, j) in {"xx": (0, 0), "yy": (1, 1), "zz": (2, 2), "xy": (0, 1)}.items():
        means[f"stress_{name}_MPa"] = sigma[..., i, j]
    for name, values in means.items():
        derived[name] = only((values * areas).sum(1) / areas.sum(1), mesh.biomass, len(mesh.cells))
    derived["surface_stretch"] = np.full(len(mesh.cells), np.nan)
    for edge in (edge for part in free_surfaces(pore) for edge in part):
        value, _, triangle = along_edge(pore, *edge)
        derived["surface_stretch"][triangle] = np.fmin(derived["surface_stretch"][triangle], value)
    return derived


def cauchy(F, P):
    """(..., 3, 3) stress of (17) and (21) over mu_L: J^(-5/3) (F F^T - tr(F F^T) / 3) + P."""
    B, J = F @ np.swapaxes(F, -1, -2), np.linalg.det(F)
    isotropic = P - np.trace(B, axis1=-2, axis2=-1) / 3 * J ** (-5 / 3)
    return J[..., None, None] ** (-5 / 3) * B + isotropic[..., None, None] * np.eye(3)


def density_at_nodes(pore, mass):
    """(N,) density at the nodes of the mesh: mass over area, or the mean of the linear least-squares fits to the points
    of the adjacent triangles."""
    nodal, body_cells = np.zeros(len(pore.mesh.points)), pore.mesh.cells[pore.mesh.biomass]
    density = mass / areas_at_points(pore)
    if pore.space.order == 1:
        nodal[np.unique(body_cells)] = density[:, 0]
        return nodal
    places, _ = rule_with(density.shape[1])
    fitted = np.linalg.lstsq(np.column_stack([np.ones(len(places)), places]), density.T, rcond=None)[0]
    node_values = (np.column_stack([np.ones(6), NODES[2]]) @ fitted).T
    for node in np.unique(body_cells):
        nodal[node] = node_values[body_cells == node].mean()
    return nodal


@EVERY_STATE
@EVERY_ORDER
def test_every_array_is_what_its_name_says(order, state):
    """They agree to round-off, because arrays are rearrangements or short sums of numbers of size one; stresses to that
    of the modulus."""
    scene, instant = instant_in(state, order)
    content, expected = results.fields(scene, instant.pore, instant.solved), derived_arrays(scene, instant)
    computed = arrays_of(content)
    assert computed.keys() == {"points", "cells", *expected}
    for name, value in expected.items():
        size = scene.growth.shear_modulus if name.endswith("_MPa") else np.nanmax(np.abs(value))
        assert computed[name] == pytest.approx(value, rel=1e-9, abs=1e-9 * size, nan_ok=True), name
        assert KNOWN[name].signed or np.nanmin(computed[name]) >= 0, name
    apart = np.nanmean(np.abs(computed["stress_xx_MPa"] - computed["stress_yy_MPa"]))
    assert state == "first" or apart > 0.05 * np.nanmean(np.abs(computed["stress_xx_MPa"])), "alike: hides an exchange"


def test_a_density_above_the_maximum_is_reported_unchanged():
    scene, instant = late_instant(2)
    full = scene.kinetics.maximum_density * areas_at_points(instant.pore)
    instant = replace(instant, pore=instant.pore.with_masses(1.2 * full, 0 * full))
    assert results.row(scene, instant)["biomass_density_max"] == pytest.approx(1.2, rel=1e-12)
    density = results.fields(scene, instant.pore, instant.solved).point_data["active_biomass"]
    assert density.max() == pytest.approx(1.2, rel=1e-12)


BALANCES = [f"{name}_balance" for name in ("acceptor", "donor", "biomass", "oxygen_demand")]


def leaky(column, leak):
    """(scene, Report) after three steps. The balance of ``column`` has a relative leak in the middle one."""
    scene, instant = late_instant(2)
    k = scene.kinetics
    grown, decayed = 2 * k.yield_coefficient, (4 - 2 * k.acceptor_to_donor_ratio) / k.decay_oxygen_demand
    even = replace(instant.ledgers[0], supplied=(5.0, 3.0), out=(1.0, 1.0), consumed=(4.0, 2.0), stored=(0.0, 0.0),
                   biomass_before=70.0, biomass_made=grown - decayed, biomass_after=70.0 + grown - decayed)
    more = leak * max(abs(grown), abs(decayed))  # over the larger of growth and decay
    # Relative to the supply: x = (s - s0) / s, so s = s0 / (1 - x).
    changes = [{"supplied": (5.0 / (1 - leak), 3.0)}, {"supplied": (5.0, 3.0 / (1 - leak))},
               {"biomass_after": even.biomass_after / (1 - leak)},
               {"biomass_made": even.biomass_made + more, "biomass_after": even.biomass_after + more}]
    middle = replace(even, **changes[BALANCES.index(column)])
    return scene, replace(instant, ledgers=(even, middle, even))


@pytest.mark.parametrize("leak", [0.01, -0.01])
@pytest.mark.parametrize("column", BALANCES)
def test_a_leak_in_the_middle_of_three_steps_is_reported_with_its_sign(column, leak):
    """timeseries.csv reports it; ledger.csv also reports the oxygen demand."""
    scene, instant = leaky(column, leak)
    row = results.row(scene, instant)
    assert row[column] == pytest.approx(leak, rel=1e-9)
    assert max(abs(row[name]) for name in BALANCES if name != column) < 1e-6
    steps = [dict(zip(results.LEDGER_COLUMNS, results.ledger_row(scene, ledger))) for ledger in instant.ledgers]
    expected = [0.0, leak if column == "oxygen_demand_balance" else 0.0, 0.0]
    assert [step["oxygen_demand_balance"] for step in steps] == pytest.approx(expected, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("time", ["updates", "midpoint"])
def test_mass_lost_by_a_new_mesh_is_not_production(time):
    """The mass that interpolation loses is a defect of the biomass and no negative production, as the oxygen demand
    shows. Linear elements interpolate masses [E8]."""
    scene = load_scene("base", ["numerics.refinement=0.5", exchange(steps=time, transfer="interpolation"),
                                'pore.width="20 um"', 'growth.end="0.4 h"', "flow.head=1e-2 cm"])
    instants = list(simulate(scene, shape=SHAPE))
    assert any(instant.remeshes for instant in instants)
    for instant in instants:
        if instant.remeshes:
            (ledger,) = instant.ledgers
            lost = ledger.biomass_after - ledger.biomass_before - ledger.biomass_made
            assert abs(lost) > 1e-6 * ledger.biomass_after
            assert results.row(scene, instant)["biomass_balance"] == lost / ledger.biomass_after
    k = scene.kinetics
    for ledger in (ledger for instant in instants for ledger in instant.ledgers):
        acceptor, donor = ledger.consumed
        grown, spent = k.yield_coefficient * donor, acceptor - k.acceptor_to_donor_ratio * donor
        assert abs(ledger.biomass_made - grown + spent / k.decay_oxygen_demand) <= 2e-4 * grown


def test_every_column_of_the_ledger_is_its_own():
    """Each column of a step's row is its own part of the ledger."""
    scene, instant = late_instant(1)
    step = replace(instant.ledgers[0], start=1.0, end=2.0, supplied=(3.0, 4.0), out=(5.0, 6.0), consumed=(7.0, 8.0),
                   stored=(9.0, 10.0), biomass_before=11.0, biomass_made=12.0, biomass_after=13.0, unmet=(14.0, 15.0))
    row = dict(zip(results.LEDGER_COLUMNS, results.ledger_row(scene, step)))
    row.pop("oxygen_demand_balance")  # tests/test_balances.py
    names = [f"{name}_{part}" for part in ("supplied", "out", "consumed", "stored") for name in ("acceptor", "donor")]
    names += ["biomass_before", "biomass_made", "biomass_after", "acceptor_unmet", "donor_unmet"]
    assert row == {"start_h": 1, "end_h": 2} | {f"{name}_pg_per_m": k for k, name in enumerate(names, 3)}


def distinct_run():
    """A run of three rows and two steps in which all numbers differ. Biomass decays in the second step."""
    series = {name: 1.0 + k + np.array([0.1, 0.2, 0.4]) for k, name in enumerate(results.COLUMNS)}
    series |= {"time_h": np.array([0.0, 1.0, 3.0]), "remeshed": np.array([0.0, 1.0, 0.0])}
    ledger = {name: 50.0 + k + np.array([0.0, 0.5]) for k, name in enumerate(results.LEDGER_COLUMNS)}
    ledger |= {"start_h": np.array([0.0, 1.0]), "end_h": np.array([1.0, 3.0])}
    ledger["biomass_made_pg_per_m"] *= [1, -1]
    return Run(None, {"tables": {}}, series, ledger)


def test_every_line_of_every_chart_is_the_column_that_it_names():
    run = distinct_run()
    charts = {chart.title: chart for chart in quantities.charts_of(run)}
    assert charts.keys() == {*CHARTS, *LEDGERS, "Ledger: biomass"}
    known = {name: 1e-6 * values / [1, 2] for name, values in run.ledger.items()} | run.series
    for title, columns in (CHARTS | LEDGERS).items():
        chart, of_steps = charts[title], title in LEDGERS
        assert chart.axis.endswith("(ug/m/h)" if of_steps else AXES.get(title, "")), title
        assert [line.label for line in chart.lines] == [*columns], title
        for line, column in zip(chart.lines, columns.values()):
            assert line.times.tolist() == ([0.0, 1.0, 1.0, 3.0] if of_steps else run.times.tolist())
            expected = np.repeat(known[column], 2) if of_steps else known[column]
            assert line.values == pytest.approx(expected, rel=1e-12, nan_ok=True), title
    present, produced = charts["Ledger: biomass"].lines
    assert (present.label, produced.label) == ("in the aggregate", "made since t = 0")
    assert present.times.tolist() == [1.0, 3.0]
    assert present.values == pytest.approx(1e-6 * run.ledger["biomass_after_pg_per_m"], rel=1e-12)
    assert produced.values == pytest.approx(1e-6 * np.cumsum(run.ledger["biomass_made_pg_per_m"]), rel=1e-12)
