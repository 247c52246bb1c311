"""The fluid's forces on the aggregate: what the scene accepts, what they are, and when shape and flow do not agree."""
from dataclasses import replace

import numpy as np
import pytest

from repro.errors import GrowthError, StageError
from repro.march.simulation import simulate
from repro.model import growth, pore, shape, traction
from repro.model.flow import Flow
from repro.results import row
from repro.scene import SceneError, load_scene


def base(*changes):
    return load_scene("base", ['numerics.preset="paper"', "numerics.refinement=0.6", 'growth.time_step="24 min"',
                               'growth.fluid_forces="included"', *changes])


@pytest.mark.parametrize("changes, said", [
    (['numerics.preset="fast"'], 'with numerics.elements = "quadratic"'),
    (["growth.new_biomass=stress_free"], 'with growth.new_biomass = "stress_free"'),
])
def test_refused(changes, said):
    with pytest.raises(SceneError, match="growth.fluid_forces") as caught:
        load_scene("base", ['numerics.preset="paper"', 'growth.fluid_forces="included"', *changes])
    assert said in str(caught.value)


def test_refused_without_flow(tmp_path):
    text = '[aggregate]\n[substrates]\n[growth]\nend = "1 h"\nfluid_forces = "included"\n'
    (tmp_path / "still.toml").write_text(text)
    with pytest.raises(SceneError, match="without .flow"):
        load_scene(tmp_path / "still.toml")


def test_the_paper_neglects_them():
    assert load_scene("base", ['numerics.preset="paper"']).growth.fluid_forces == "neglected"


def test_the_unit_is_that_of_water_pressure():
    """A column of 1 cm of water is 97.9 Pa. Mutant: density taken for kg/m3."""
    drive = base().flow
    centimetre = 1e4 * traction.MPA_PER_UM * drive.density * drive.gravity
    assert centimetre == pytest.approx(998 * 9.81 * 0.01 * 1e-6, rel=1e-12)


def test_an_even_head_pushes_along_the_normals():
    """On a seed: the sum over the arc is the head times its width, downwards. Mutant: sign."""
    now = pore.seeded(base())
    still = Flow(0.0, 0 * now.mesh.points, np.full(len(now.mesh.points), 3.0), 0 * now.mesh.edges[:, 0], 0.0, 0.0, 0.0)
    on = traction.nodal(now.mesh, still, 1.0, "laplacian")
    arc = now.outline.points[now.wall == 0]
    inner = now.mesh.loop[now.wall == 0]
    width = 2 * 5.0 - (5.0 - arc[0, 0])  # half of the first and of the last edge push the contact lines
    assert on[inner, 1].sum() == pytest.approx(-3.0 * width, rel=1e-12)
    assert abs(on[inner, 0].sum()) < 1e-12


def test_without_forces_the_same_bits():
    """forces = None and no argument are one path."""
    now = pore.seeded(base())
    theta = 1.2 * now.theta
    nodes = now.mesh.body
    held = shape.held_at(len(nodes), now.mesh.body_loop, now.wall, now.fixed)
    body = growth.Body(now.origin[nodes], now.mesh.body_triangles, held)
    start = now.mesh.points[nodes]
    found = [growth.equilibrium(body, theta, start, np.zeros(len(nodes)), start, *given)
             for given in ((), (None,), (np.zeros_like(start),))]
    assert np.array_equal(found[0].position, found[1].position)
    assert np.abs(found[0].position - found[2].position).max() < 1e-12


def test_water_that_is_far_too_heavy_is_refused():
    """Its pressure is a thousand times the stiffness: an error that says what to do, neither a hang nor a shape."""
    said = base('flow.density="1e9 mg/cm^3"')
    now = pore.seeded(said)
    with pytest.raises(StageError, match="try a"):
        shape.expand(said, now, 1.1 * now.theta)


def test_rounds_that_do_not_end_are_an_error(monkeypatch):
    monkeypatch.setattr(shape, "FORCE_ROUNDS", 1)
    said = base()
    now = pore.seeded(said)
    with pytest.raises(GrowthError, match="do not agree after 1 rounds, a node still moves by .* um: .*try a shorter"):
        shape.expand(said, now, 1.1 * now.theta)


def test_a_run_with_them_is_pushed_downstream_and_counts_its_rounds():
    rows = {}
    for word in ("neglected", "included"):
        said = base('growth.end="2 h"', f'growth.fluid_forces="{word}"')
        *_, last = simulate(said)
        rows[word] = row(said, last), last.iterations["growth"]
    plain, pushed = (rows[word][0] for word in rows)
    assert 0 < pushed["upstream_um"] - plain["upstream_um"] < 1e-4
    assert 0 < pushed["downstream_um"] - plain["downstream_um"] < 1e-4
    assert rows["included"][1] > rows["neglected"][1]
    assert abs(pushed["biomass_balance"]) < 1e-10


def test_a_plug_is_pushed_through_contact_and_remeshes():
    """Shape and flow agree in every step although new meshes must be made for the flow within the rounds."""
    said = load_scene("wide", ['numerics.preset="paper"', "numerics.refinement=0.5", 'growth.time_step="24 min"',
                               'pore.width="20 um"', 'growth.end="16.4 h"', 'growth.fluid_forces="included"'])
    instants = list(simulate(said))
    assert instants[-1].pore.contact and sum(i.remeshes for i in instants) > 2


def test_a_shape_with_its_own_mesh_needs_no_other():
    said = base()
    now = pore.seeded(said)
    around = traction.surroundings(said, now, now)
    assert around.grid is now.mesh and around.share.shape == (len(now.mesh.body), 1)
    twice = replace(said, flow=replace(said.flow, density=2 * said.flow.density))
    one, two = (traction.forces(s, around, now) for s in (said, twice))
    assert np.allclose(two, 2 * one, rtol=1e-14)
