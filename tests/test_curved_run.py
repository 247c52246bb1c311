"""Runs on curved triangles, and the presets that choose them."""
from dataclasses import replace

import meshio
import numpy as np
import pytest
from repro.curved import coupling
from repro.curved import growth as mechanics
from repro.curved import results as curved_results

from repro import results
from repro.march import simulation
from repro.model.kinetics import growth_rate, inert_rate
from repro.model.transport import Concentrations
from repro.scene import PRESETS, Numerics, load_scene, parse_scene, scene_tables
from repro.scene.rules import CURVED
from repro.scene.units import SceneError
from tests.strategies import scene


def base(*changes):
    return load_scene("base", ('numerics.preset="fast"', *changes))


def run(made):
    """All instants of a scene."""
    return list(simulation.simulate(made))


@pytest.fixture(scope="module")
def contact():
    """Through contact with the opposite wall, with its scene."""
    made = scene("17.9 um", "20 um", velocity="2.9 m/day", growth={"end": "1 h"}, numerics={"preset": "fast"})
    return made, run(made)


def test_growth_in_plenty_is_exponential_and_round():
    """Diffusion holds the supply: mass by (9)-(10), a half-disc. Mutants: rates of half the step's length, mass lost at
    the remesh, arcs straightened by the moved mesh."""
    made = base('growth.end="6 h"', 'output.times=["6 h"]')
    fast = {name: replace(getattr(made.substrates, name), diffusivity=1e13, diffusivity_in_aggregate=1e13)
            for name in ("acceptor", "donor")}
    made = replace(made, flow=None, substrates=replace(made.substrates, **fast))
    first, last = run(made)
    rise, left = (rate(*(10.0, 10.0)[:n], made.substrates, made.kinetics) for rate, n in ((growth_rate, 2),
                                                                                            (inert_rate, 1)))
    wanted = first.pore.outline.area * (np.exp(6 * rise) + left / rise * np.expm1(6 * rise))
    assert last.pore.outline.area == pytest.approx(wanted, rel=1e-6)
    free = last.pore.outline.wall == 0
    assert np.allclose(np.hypot(*last.pore.outline.points[free].T), np.sqrt(2 * wanted / np.pi), rtol=1e-4)


def test_the_first_guess_at_a_step_s_end():
    """As much change again as the first half has made; not below zero, nor on another mesh. Mutants: the half's own
    state, a guess below zero."""
    start, half, other = (Concentrations(np.array(a), np.array(b)) for a, b in (
        ([3.0, 2.0], [5.0, 4.0]), ([2.5, 1.5], [5.0, 3.5]), ([1.0], [1.0])))
    guess = coupling._extrapolated(start, half)
    assert np.array_equal(guess.acceptor, [2.0, 1.0]) and np.array_equal(guess.donor, [5.0, 3.0])
    assert coupling._extrapolated(start, other) is start
    spent = replace(half, acceptor=np.array([2.5, 0.5]))
    assert coupling._extrapolated(start, spent) is spent


def test_density_is_kept(contact):
    """J = theta: (X_A + X_I) / X_m is one but for what the linear pressure cannot see, mass over area exactly. Mutants:
    J = theta at the corners only, the expansion forgotten at a remesh."""
    made, found = contact
    for instant in found:
        share, least, largest = instant.pore.composition(made.kinetics.maximum_density)
        assert instant.pore.mass() == pytest.approx(instant.pore.mesh.area(), rel=1e-9)
        assert 0.9 < least <= largest < 1.1
    shares = [instant.pore.composition(1.0)[0] for instant in found]
    assert (np.diff(shares) > 0).all() and 0 < shares[-1] < 0.1


def test_contact_is_made_and_kept(contact):
    """Arcs on the upper wall lie on it, middles with their corners; one node there is fixed; the surface grows.
    Mutants: a middle that joins alone, no fixed point, contact that opens."""
    made, found = contact
    after = [instant.pore for instant in found if instant.pore.contact]
    assert 2 <= len(after) < len(found)
    for now in after:
        shape = now.outline
        top = shape.wall == 2
        assert (shape.points[top, 1] == made.pore.width).all() and shape.thickness == made.pore.width
        assert shape.fixed[top].sum() == 1 and not shape.fixed[1::2].any()
        middles = np.flatnonzero(top[1::2]) * 2 + 1
        assert (top[middles - 1] & top[(middles + 1) % len(top)]).all()
        assert not now.mesh.turned_over().any()
    widths = [np.ptp(now.outline.points[now.outline.wall == 2, 0]) for now in after]
    assert (np.diff(widths) >= -1e-9).all() and widths[-1] > 5


def test_without_flow_both_sides_are_alike():
    """To what an unsymmetric mesh makes of it. Mutant: the fixed point beside the middle."""
    *_, last = run(replace(base('growth.end="8 h"', 'output.times=["8 h"]'), flow=None))
    shape = last.pore.outline
    assert abs(shape.downstream + shape.upstream) < 2e-4 * shape.downstream
    assert shape.area > 100


def test_it_is_the_paper_s_aggregate():
    """Both schemes at 4 h, within the paper's own error of 1 %. Mutant: another law of growth."""
    ends = ('growth.end="4 h"', 'output.times=["4 h"]')
    ours, theirs = run(base(*ends))[-1], run(load_scene("base", ('numerics.preset="paper"', *ends)))[-1]
    for name in ("area", "upstream", "thickness"):
        assert getattr(ours.pore.outline, name) == pytest.approx(getattr(theirs.pore.outline, name), rel=1e-2)
    assert ours.solved.flow.conductivity == pytest.approx(theirs.solved.flow.conductivity, rel=2e-2)


def test_rates_are_carried_back_from_a_new_mesh():
    """Rates that are linear in the place half way come back as they are there. Mutants: rates by node number, places of
    the start."""
    made = base('aggregate.radius="20 um"')
    now = coupling.seeded(made)
    half = replace(now, mesh=now.mesh.moved(now.mesh.points * [1.1, 1.1]))
    there = coupling.remesh(made, now, half, coupling.solve(made, now).concentrations)
    x, y = there.mesh.points.T
    back = coupling._carried_back(there, half, (2 * x + y, 3 - y))
    places = half.mesh.points[now.mesh.body]
    assert np.allclose(back[0][now.mesh.body], 2 * places[:, 0] + places[:, 1], atol=1e-6)
    assert np.allclose(back[1][now.mesh.body], 3 - places[:, 1], atol=1e-6)


def test_fields_are_written_on_curved_triangles(contact, tmp_path):
    """Six nodes, names with units, X_A + X_I = 1 in the aggregate, J and theta alike. Mutants: corners only, heads of
    the corners at the middles' places."""
    made, found = contact
    written = curved_results.fields(made, found[-1].pore, found[-1].solved)
    results.write_fields(tmp_path / "fields.vtu", written)
    read = meshio.read(tmp_path / "fields.vtu")
    assert read.cells[0].type == "triangle6" and len(read.points) == len(found[-1].pore.mesh.points)
    body = found[-1].pore.mesh.body
    assert np.allclose((read.point_data["active_biomass"] + read.point_data["inert_biomass"])[body], 1.0)
    assert np.allclose(read.cell_data["theta"][0], read.cell_data["J"][0], rtol=0.05)
    assert (read.cell_data["theta"][0][found[-1].pore.mesh.biomass] > 1).all()
    grid, head = found[-1].pore.mesh, read.point_data["head_cm"]
    assert np.allclose(head[grid.cells[:, 3]], 0.5 * (head[grid.cells[:, 0]] + head[grid.cells[:, 1]]))
    assert head[grid.inlet].mean() > 0 and mechanics.System(mechanics.of(
        found[-1].pore)).deformed(grid.points[body]).J.min() > 0


TABLES = {"aggregate": {}, "flow": {"head": "1e-3 cm"}, "substrates": {}, "growth": {"end": "1 h"}}


def numerics(**given):
    return parse_scene({**TABLES, "numerics": given}, "test", "test.toml").numerics


@pytest.mark.parametrize("preset", PRESETS)
def test_a_preset_changes_the_defaults(preset):
    """All that it names, nothing else. Mutant: a key of one preset left out."""
    assert numerics(preset=preset) == replace(Numerics(), preset=preset, **PRESETS[preset])


def test_presets_say_what_they_are():
    """The paper's is the paper's scheme; the others are curved, second in time, the accurate one finer. Mutant: fast
    and accurate exchanged."""
    paper, fast, accurate = (numerics(preset=name) for name in ("paper", "fast", "accurate"))
    assert (paper.elements, paper.time, paper.refinement) == ("linear", "updates", 1.0)
    assert fast.elements == accurate.elements == "quadratic" and fast.time == accurate.time == "midpoint"
    assert fast.refinement < accurate.refinement and fast.tolerance > accurate.tolerance


def test_what_is_written_wins_over_the_preset():
    """Mutant: the preset laid over the scene's keys."""
    found = numerics(preset="fast", refinement=0.8, elements="linear", time="updates")
    assert (found.refinement, found.elements, found.time, found.tolerance) == (0.8, "linear", "updates", 0.0075)


@pytest.mark.parametrize("preset", PRESETS)
def test_a_written_scene_is_read_as_the_same(preset):
    """With the preset and all that it chose spelt out. Mutant: the preset's name lost, or applied again over them."""
    made = parse_scene({**TABLES, "numerics": {"preset": preset, "refinement": 0.77}}, "test", "test.toml")
    assert parse_scene(scene_tables(made), "test", "test.toml") == made


@pytest.mark.parametrize("key, other", [("time", "updates"), ("transport", "gear"), ("transfer", "linear"),
                                        ("interface", "traction"), ("inlet", "mean"), ("fixed_point", "rechosen")])
def test_what_curved_triangles_cannot_do_is_refused(key, other):
    """By the key's name, with what there is. Mutant: a row of CURVED left out (it would run as if not written)."""
    assert key in CURVED
    with pytest.raises(SceneError, match=rf'numerics.{key}.*"{CURVED[key]}" is needed with numerics.elements'):
        numerics(preset="fast", **{key: other})


def test_other_combinations_that_are_refused():
    """Stress-free new biomass on curved triangles, gear with the midpoint rule, a preset that there is not. Mutant: the
    rule under the wrong key."""
    with pytest.raises(SceneError, match='growth.new_biomass.*"stressed" is needed'):
        parse_scene({**TABLES, "growth": {"end": "1 h", "new_biomass": "stress_free"},
                     "numerics": {"preset": "fast"}}, "test", "test.toml")
    with pytest.raises(SceneError, match='numerics.transport.*"quasi_steady" is needed with numerics.time'):
        numerics(preset="paper", time="midpoint", transport="gear")
    for wrong in ("quick", 3, ["fast"]):
        with pytest.raises(SceneError, match="numerics.preset"):
            numerics(preset=wrong)
