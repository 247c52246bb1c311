"""Schemes: what each choice changes, where a scheme is refused, and what keeps it. The case transport-as-printed tests
the defects of the printed choices, and the cases coupling-ledger and coupling-one-balance that the others conserve."""
from dataclasses import asdict, replace

import numpy as np
import pytest

import repro
from repro import results
from repro.march.simulation import shaped, simulate
from repro.scene import PRESETS, load_scene, scene_hash
from repro.schemes import CURVED, PAPER, PRINTED

BRIEF = ('growth.end="0.4 h"', "numerics.refinement=0.3", 'output.times=["0.4 h"]')


def effluent(scheme):
    """The acceptor that leaves at the end of a brief run of base."""
    preset = "paper" if scheme.elements == "linear" else "fast"
    scene = load_scene("base", [f"numerics.preset={preset}", *BRIEF], scheme=scheme)
    *_, report = simulate(scene)
    return results.row(scene, report)["effluent_acceptor_mg_per_L"]


@pytest.mark.parametrize("scheme", [PAPER, CURVED], ids=["paper", "curved"])
def test_carriers_differ(scheme):
    """w is nearly u, and no bit more: the effluent changes by less than 0.1 % of the supply."""
    w, u = (effluent(replace(scheme, carrier=carrier)) for carrier in ("w", "u"))
    assert 0 < abs(w - u) < 1e-2


def test_the_presets_have_their_schemes():
    """The other presets than the paper's have the curved scheme."""
    for preset in PRESETS:
        scheme = load_scene("base", [f"numerics.preset={preset}"]).numerics.scheme
        assert scheme == {"paper": PAPER, "as_printed": PRINTED}.get(preset, CURVED)


@pytest.mark.parametrize("change, message", [
    ({"carrier": "v"}, 'scheme: carrier: "w" or "u" is needed, not \'v\''),
    ({"elements": "cubic"}, 'scheme: elements: "linear" or "quadratic" is needed, not \'cubic\''),
    ({"elements": "quadratic"}, 'scheme: transfer with quadratic elements: "shares" is needed, not \'projection\''),
    ({"transfer": "shares"}, 'scheme: transfer with linear elements: "projection" or "interpolation" is needed, not')])
def test_a_scheme_that_does_not_exist_is_refused(change, message):
    with pytest.raises(ValueError) as error:
        replace(PAPER, **change)
    assert str(error.value).startswith(message)


def test_a_scheme_of_another_type_is_refused():
    for function in (repro.solve, repro.simulate):
        with pytest.raises(TypeError, match="scheme: Scheme is needed, not 'paper'"):
            function("base", scheme="paper")


def test_rules_of_a_scene_know_its_scheme():
    """Gear's method needs updates, and a permeability needs quadratic elements."""
    with pytest.raises(repro.SceneError, match='"quasi_steady" is needed'):
        load_scene("base", ["numerics.transport=gear"], scheme=replace(PAPER, steps="midpoint"))
    permeable = ["flow.permeability=1e-15 m^2"]
    with pytest.raises(repro.SceneError, match="it needs quadratic elements"):
        load_scene("base", [*permeable, "numerics.preset=fast"], scheme=PAPER)
    assert load_scene("base", permeable, scheme=CURVED).numerics.scheme is CURVED


def test_no_folder_gets_a_run_with_a_scheme_of_its_own(tmp_path):
    """No file of a run would state it."""
    scene = load_scene("base", BRIEF, scheme=PRINTED)
    for function, arguments in ((repro.run, (tmp_path / "run",)),
                                (repro.sweep, (["pore.width=50 um, 60 um"], tmp_path / "sweep"))):
        with pytest.raises(repro.SceneError, match="^base: a run in a folder has the scheme of numerics.preset"):
            function(scene, *arguments)
    assert not [*tmp_path.iterdir()]


def test_a_scheme_stays_with_its_scene():
    """Through changes of keys and another shape; another scheme replaces it. Hash and provenance state it."""
    scene = load_scene("base", scheme=PRINTED)
    outline = np.array([(-5.0, 0.0), (0.0, 5.0), (5.0, 0.0)])
    for changed in (load_scene(scene, ["pore.width=60 um"]), shaped(scene, outline), load_scene(scene)):
        assert changed.numerics.scheme == PRINTED
    assert load_scene(scene, scheme=PAPER).numerics.scheme == PAPER
    assert scene_hash(scene) != scene_hash(load_scene("base"))
    assert results.provenance(scene)["scheme"] == asdict(PRINTED)
    assert "scheme" not in results.provenance(load_scene("base"))
