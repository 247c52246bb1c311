"""The condensed bubble: its closed form, what the scene accepts, and a run with it."""
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from skfem.quadrature import get_quadrature_tri

from repro.fem.mesh import Mesh, triangle_areas
from repro.march.simulation import simulate
from repro.model.flow import Bubble
from repro.results import row
from repro.scene import SceneError, load_scene

corners = st.lists(st.floats(-1.0, 1.0), min_size=6, max_size=6).map(lambda x: np.array(x).reshape(3, 2)).filter(
    lambda x: triangle_areas(x, np.array([[0, 1, 2]]))[0] > 1e-3)


def one_triangle(points) -> Mesh:
    return Mesh.of(points, np.array([[0, 1, 2]]), np.array([False]), np.empty(0, int), 1.0, (0.0, 1.0))


def integrated(points, viscosity, interface):
    """tau by quadrature of the bubble and its gradient, from the definition."""
    (s, t), weight = get_quadrature_tri(6)
    L, grid = np.stack([1 - s - t, s, t]), one_triangle(points)
    g, area = grid.gradients[0], grid.areas[0]
    b = 27 * L.prod(axis=0)
    slope = 27 * (np.outer(g[0], L[1] * L[2]) + np.outer(g[1], L[0] * L[2]) + np.outer(g[2], L[0] * L[1]))
    M = 2 * area * np.einsum("q,iq,jq->ij", weight, slope, slope)
    block = viscosity * (np.trace(M) * np.eye(2) + (M if interface == "traction" else 0))
    return (2 * area * weight @ b) ** 2 / area * np.linalg.inv(block)


@given(corners, st.floats(0.1, 1e4), st.sampled_from(["laplacian", "traction"]))
def test_tau_is_that_of_the_integrals(points, viscosity, interface):
    found = Bubble().mobility(one_triangle(points), np.array([viscosity]), interface)[0]
    wanted = integrated(points, viscosity, interface)
    assert np.abs(found - wanted).max() < 1e-10 * np.abs(wanted).max()


def test_an_equilateral_triangle_has_nearly_the_stabilised_tau():
    """h^2 / (80 nu) of the side h: h_tau^2 / (106.7 nu)."""
    grid = one_triangle(np.array([[0.0, 0.0], [1.0, 0.0], [0.5, np.sqrt(0.75)]]))
    found = Bubble().mobility(grid, np.ones(1), "laplacian")[0]
    assert np.allclose(found, np.eye(2) / 80, rtol=1e-12)
    assert np.allclose(grid.circumdiameter**2 / (320 / 3), 1 / 80, rtol=1e-12)


@pytest.mark.parametrize("elements", ["quadratic", "cubic"])
def test_the_paper_has_no_bubble_and_higher_orders_take_none(elements):
    assert load_scene("base", ['numerics.preset="paper"']).numerics.flow_element == "stabilised"
    with pytest.raises(SceneError, match='numerics.flow_element = "bubble": "stabilised" is needed with') as refused:
        load_scene("base", [f"numerics.elements={elements}", "numerics.flow_element=bubble"])
    assert "\n" not in str(refused.value)


def test_a_run_with_bubbles_balances_and_stays_near_the_stabilised_one():
    """The scene's word reaches the flow (the runs differ); substrates balance since w is divergence-free."""
    rows = {}
    for element in ("stabilised", "bubble"):
        said = load_scene("base", ['numerics.preset="paper"', 'growth.end="1 h"', f"numerics.flow_element={element}"])
        *_, last = simulate(said)
        rows[element] = row(said, last)
    assert abs(rows["bubble"]["donor_balance"]) < 1e-10
    speeds = [rows[name]["mean_velocity_m_per_d"] for name in rows]
    assert 0 < abs(speeds[1] / speeds[0] - 1) < 1e-4
