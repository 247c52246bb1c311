"""The laws for networks with a scene's own kinetics: its rates, supplies, file and shapes, and what is refused."""
import dataclasses
import json

import numpy as np
import pytest

import repro
from repro.cli import main
from repro.model.meshing import seeded
from repro.network import own, resistance, uptakes
from repro.results.files import sealed
from verification.network import own as record

LAMBDA = 2000.0
SCENE = {"pore": {"width": "60 um"}, "aggregate": {}, "flow": {"mean_velocity": "1 m/d"},
         "substrates": {"acceptor": {"supply": "8 mg/L"}, "donor": {"supply": "6 mg/L", "half_saturation": "0.5 mg/L"}},
         "kinetics": {"maximum_utilization_rate": "4 1/d"}, "numerics": {"preset": "sketch"}}


@pytest.fixture(scope="module")
def table():
    """Eight half-discs of the scene, and the fit to them."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(own, "HALF_DISCS", 8)
        patch.setattr(own, "MOST_FITS", 3)
        scene = repro.load_scene(SCENE)
        return own._fitted(scene, *own.solved(scene, np.random.default_rng(own.SEED)))


@pytest.fixture(autouse=True)
def solutions(tmp_path, monkeypatch, table):
    """The scenes that are solved, here by the table. Each test has a cache folder of its own."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(own, "_KNOWN", {})
    scenes = []
    monkeypatch.setattr(own, "solved", lambda scene, *rest: scenes.append(scene) or table[:2])
    monkeypatch.setattr(own, "_fitted", lambda *rest: table)
    return scenes


def test_a_small_aggregate_takes_up_at_the_rates_of_the_scene(solutions):
    """(7)-(8) in closed form at the supplies of the scene, and at others. The table is computed once."""
    scene, area = repro.load_scene(SCENE), 1e-8
    for acceptor, donor in ((None, None), (2.0, 1.0)):
        taken = repro.uptake(area, 50.0, 1.0, acceptor, donor, scene=scene)
        m_a, m_d = (supply / (supply + k) for supply, k in ((acceptor or 8.0, 1.0), (donor or 6.0, 0.5)))
        kinetics = scene.kinetics
        assert taken.donor == pytest.approx(4 / 24 * m_a * m_d * kinetics.maximum_density * area, rel=1e-4)
        decay = 1.42 * kinetics.degradable_fraction * kinetics.decay_coefficient * m_a * kinetics.maximum_density * area
        assert taken.acceptor - 1.52 * taken.donor == pytest.approx(decay, rel=1e-3)
    assert len(solutions) == 1


def test_a_scene_limits_the_range():
    """Widths, supplies and areas: no shape of this scene touches both walls."""
    good = np.array([1000.0, 60.0, 1.0, 8.0, 6.0])
    for index, value, message in ((1, 29.0, "width = 29 is not known; 30 to 120 is"), (3, 8.1, "acceptor = 8.1 is"),
                                  (4, 6.1, "donor = 6.1 "), (0, 1.6 * 3600, "area / width^2 = 1.6 is not known; 0 to")):
        arguments = good.copy()
        arguments[index] = value
        with pytest.raises(ValueError, match=message.replace("^", r"\^")):
            repro.uptake(*arguments, scene=SCENE)
    with pytest.raises(ValueError, match=r"added_resistance: area / width\^2 = 1.6 is not known; 0 to 1.5"):
        repro.added_resistance(1.6, 1.0, scene=SCENE)
    with pytest.raises(ValueError, match="acceptor and donor, or a scene with their supplies, are needed"):
        repro.uptake(1000.0, 60.0, 1.0)


def test_a_damaged_or_foreign_file_is_made_again(solutions):
    """One bit, the end, another scene's key, another shape of an array, a list in place of an object, no text."""
    scene = repro.load_scene(SCENE)
    file = own.tabulated(scene).file
    good = file.read_bytes()
    content = json.loads(good)
    del content["checksum"]
    bad = (good.replace(b"1", b"2", 1), good[:-40], sealed({**content, "key": "0" * 16}).encode(),
           sealed({**content, "constants": [[1.0, 2.0]]}).encode(), sealed({**content, "bound": "x"}).encode(),
           b"[]\n", b"\xff\x80", sealed({"key": content["key"]}).encode())
    for number, text in enumerate(bad):
        file.write_bytes(text)
        own._KNOWN.clear()
        own.tabulated(scene)
        assert (len(solutions), file.read_bytes()) == (2 + number, good)
    own._KNOWN.clear()
    assert own.tabulated(scene).uptake.bound == content["bound"] and len(solutions) == 1 + len(bad)


def test_a_file_is_of_one_scene_and_one_code(monkeypatch):
    """The name has the hash of both."""
    scene, other = repro.load_scene(SCENE), repro.load_scene(SCENE, ["kinetics.yield_coefficient=0.5"])
    keys = {own._key(scene), own._key(other)}
    monkeypatch.setattr(own, "source_hash", lambda: "other")
    assert len({*keys, own._key(scene)}) == 3


def test_a_table_that_cannot_be_kept_is_used_with_a_warning(tmp_path, solutions):
    (tmp_path / "cache").write_text("a file")
    with pytest.warns(UserWarning, match="the law for networks is not kept: "):
        repro.uptake(1000.0, 60.0, 1.0, scene=SCENE)
    assert len(solutions) == 1


@pytest.mark.parametrize("changes, need", [
    (["flow.permeability=1e-15 m^2"], "one viscous aggregate between two walls"),
    (['pore.upper_wall="symmetry"'], "one viscous aggregate between two walls"),
    (['kinetics.law="Haldane"'], "an uptake that rises"), (['kinetics.law="zero order"'], "no front"),
    (['kinetics.decay="unlimited"'], "no decay without acceptor"), (["--unset flow"], "a flow"),
    (["--unset substrates.donor"], "both"), (["--unset aggregate", "--unset kinetics"], "one viscous")])
def test_a_scene_of_another_form_or_without_a_part_is_refused(changes, need):
    unset = [change.removeprefix("--unset ") for change in changes if change.startswith("--unset ")]
    scene = repro.load_scene(SCENE, () if unset else changes, unset=unset)
    for law in (lambda: repro.uptake(1000.0, 60.0, 1.0, scene=scene),
                lambda: repro.added_resistance(1000.0, 60.0, scene=scene)):
        with pytest.raises(repro.SceneError, match=f"scene: the laws for networks need .*{need}"):
            law()


def test_the_resistance_follows_grown_shapes():
    """Between two shapes of a kind, and beyond the last one. The bounds include the law's with it and without it."""
    share = np.array([0.4, 0.5, 0.6, 0.9])
    law = np.array(repro.added_resistance(share, 1.0))
    shapes = np.array([[0, 0.4, 1.2 * law[0, 0]], [0, 0.6, 0.9 * law[0, 2]], [1, 2.0, 1.0]])
    length, least, most = resistance.resistance(share, 1.0, None, LAMBDA, shapes=shapes)
    assert length / law[0] == pytest.approx([1.2, 1.05, 0.9, 0.9])
    assert least / law[1] == pytest.approx([1.0, 1.0, 0.9, 0.9])
    assert most / law[2] == pytest.approx([1.2, 1.05, 1.0, 1.0])
    untouched = resistance.resistance(share, 1.0, None, LAMBDA, shapes=shapes[2:])
    assert np.array(untouched) == pytest.approx(law)


def test_the_viscosity_ratio_is_that_of_the_scene():
    scene = {**SCENE, "flow": {"mean_velocity": "1 m/d", "viscosity_ratio": 500}}
    assert repro.added_resistance(1.3, 1.0, scene=scene) == repro.added_resistance(1.3, 1.0, None, 500.0)


@pytest.mark.parametrize("count", [1, 1000])
def test_a_thousand_throats_need_few_evaluations(monkeypatch, count):
    """All throats at once, in at most half of the 24 x 13 evaluations of two nested bisections."""
    calls = []
    rates = uptakes.Throats._uptake_at
    monkeypatch.setattr(uptakes.Throats, "_uptake_at", lambda *args: calls.append(1) or rates(*args))
    random = np.random.default_rng(1)
    width = random.uniform(45, 90, count)
    repro.uptake(random.uniform(0.02, 1.2, count) * width**2, width, 1.0, 8.0, 5.0)
    assert len(calls) <= 24 * 13 / 2


def test_the_command_computes_once(capsys, solutions, tmp_path):
    scene = tmp_path / "mine.toml"
    scene.write_text(str(repro.load_scene(SCENE)))
    for _ in range(2):
        assert main(["network-law", str(scene), "--quiet"]) == 0
    printed = capsys.readouterr().out
    assert "widths of 30 to 120 um, up to 8 mg/L of acceptor and 6 mg/L of donor" in printed
    assert printed.count("network-law-") == 2 and len(solutions) == 1


def test_the_table_holds_for_its_states(table):
    """The bound is 1.25 times the largest error over the spread. Sizes and supplies are in their ranges."""
    scene = repro.load_scene(SCENE)
    aggregates = own.throats(own._law(scene, table), table.states)
    apart = np.abs(table.states.T[5:] / aggregates.uptake()[:2] - 1).max(axis=0)
    assert len(apart) == 8 and (apart < aggregates.bound()).all()
    assert (apart / aggregates.bound()).max() == pytest.approx(0.8, rel=0.2)
    widths, supplies = table.states[:, 1], table.states[:, 3:5]
    assert (widths > 30).all() and (widths < 120).all() and (supplies < [8, 6]).all()


def test_a_state_is_a_solution_of_its_scene(table):
    """Its half-disc as a scene of its own, in a pore of 15 W: the uptakes of the row at t = 0 (pg/m/h)."""
    area, width, velocity, acceptor, donor, *taken = table.states[0]
    state = {**SCENE, "pore": {"width": f"{width} um", "length": f"{15 * width} um"},
             "aggregate": {"radius": f"{np.sqrt(2 * area / np.pi)} um"}, "flow": {"mean_velocity": f"{velocity} m/d"},
             "substrates": {"acceptor": {"supply": f"{acceptor} mg/L"},
                            "donor": {"supply": f"{donor} mg/L", "half_saturation": "0.5 mg/L"}}}
    run = repro.solve(state)
    assert taken == pytest.approx([1e6 * run[f"{name}_uptake_ug_per_m_per_h"][0] for name in ("acceptor", "donor")],
                                  rel=1e-3)
    assert taken[0] != pytest.approx(taken[1], rel=0.05)


def test_a_fit_recovers_the_constants_of_the_law(table):
    """To three digits, from those of Table 1 on, and from uptakes that other constants make."""
    scene, random = repro.load_scene(SCENE), np.random.default_rng(3)
    states = np.column_stack([random.uniform(10, 3000, 40), np.full(40, 60.0), np.exp(random.uniform(-6, 2, 40)),
                              random.uniform(0.5, 8, 40), random.uniform(0.5, 6, 40)])
    aggregates = own.throats(own._law(scene, table), states)
    other = uptakes.Transport(6.1, 0.42, 0.8, 0.45)
    solutions = dataclasses.replace(aggregates, law=aggregates.law._replace(transports=(other, other))).uptake()[:2]
    assert own.fit(aggregates, solutions, uptakes.TRANSPORTS[0]) == pytest.approx(other, rel=5e-3)


def test_the_length_of_a_half_disc_is_that_of_the_table():
    """r of a half-disc in a pore of 15 W, against the law of its area."""
    pore = seeded(repro.load_scene({**SCENE, "pore": {"width": "60 um", "length": "900 um"},
                                    "aggregate": {"radius": "30 um"}}))
    share = pore.boundary.area / 3600
    assert own.added_length(pore.space, LAMBDA) == pytest.approx(
        repro.added_resistance(share, 1.0).length, rel=0.05)


def test_the_run_of_a_scene_gives_shapes():
    """They are apart in area, and the law with them has their own r."""
    scene = repro.load_scene({**SCENE, "aggregate": {"radius": "12 um"}, "growth": {"end": "10 h"},
                              "numerics": {"preset": "fast"}})
    pores = list(own._grown(scene, lambda time, end: None))
    shares = np.array([pore.boundary.area for pore in pores]) / 3600
    assert len(shares) >= 3 and (shares[1:] > own.STEP * shares[:-1]).all()
    lengths = np.array([own.added_length(pore.space, LAMBDA) for pore in pores])
    assert lengths == pytest.approx(resistance.resistance(shares, 1.0, None, LAMBDA).length, rel=0.2)


def test_the_laws_of_two_other_scenes_hold_for_states_of_another_seed():
    """The record, of both laws."""
    for name, scene in json.loads(record.RECORD.read_text(encoding="utf-8")).items():
        assert name in record.SCENES and scene["own"]["states"] > 100
        for law in (scene["own"], scene["table_1"]):
            assert law["within"] == law["states"] and law["worst"] < 0.08
