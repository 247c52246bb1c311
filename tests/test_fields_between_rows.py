"""Fields at times between rows, from memory and from a folder; probes, profiles and grids of fields."""

import warnings
from functools import cache

import numpy as np
import pytest

import repro
from repro.results import COLUMNS, tables
from repro.results.files import sha256_of
from repro.runs import scripts
from tests.strategies import same_arrays

FEW = {"numerics.preset": "fast", "growth.end": "0.6 h", "output.times": ["0 h", "0.3 h", "0.6 h"]}
MORE = {**FEW, "output.times": ["0 h", "0.1 h", "0.3 h", "0.35 h", "0.55 h", "0.6 h"]}
TIMES = [0.1, "21 min", 0.55]


@cache
def solved(preset, more=False):
    return repro.solve("base", {**(MORE if more else FEW), "numerics.preset": preset})


@pytest.mark.parametrize("preset", ["fast", "paper"])
@pytest.mark.parametrize("time", TIMES)
def test_fields_between_rows_are_those_of_a_row_there(preset, time):
    assert same_arrays(solved(preset).fields(time), solved(preset, more=True).fields(time))


@pytest.mark.parametrize("preset", ["fast", pytest.param("paper", marks=pytest.mark.thorough)])
def test_a_run_in_a_folder_has_them_too_and_stays_as_it_is(tmp_path, preset):
    """Before and after the state that is saved near the end of a run. Each time is computed once."""
    results = repro.run("base", tmp_path / "run", {**FEW, "numerics.preset": preset})
    sums = {path: sha256_of(path) for path in (tmp_path / "run").rglob("*") if path.is_file()}
    with warnings.catch_warnings(action="error"):
        for time in TIMES:
            assert same_arrays(results.fields(time), solved(preset, more=True).fields(time))
    assert {path: sha256_of(path) for path in (tmp_path / "run").rglob("*") if path.is_file()} == sums
    assert results.fields(0.1) is results.fields("6 min") and results.outline(0.1).time == 0.1


def test_a_run_starts_again_from_its_saved_state(tmp_path, monkeypatch):
    """Not from t = 0, if the state is early enough; a damaged or later one is left out."""
    starts = []
    report_at = tables.report_at
    monkeypatch.setattr(tables, "report_at", lambda scene, state, time: starts.append(
        state.time if state else None) or report_at(scene, state, time))
    results = repro.run("base", tmp_path / "run", {**FEW, "growth.end": "5 h"})
    results.fields(4.99)
    results.fields(0.05)
    assert 0.6 <= starts[0] < 4.99 and starts[1] is None
    (tmp_path / "run" / "checkpoint.last").write_bytes(b"damaged")
    results.fields(4.98)
    assert starts[2] is None
    solved("fast").fields(0.45)
    assert starts[3] and 0.25 < starts[3] <= 0.45


def test_a_run_of_other_versions_warns(tmp_path, monkeypatch):
    results = repro.run("base", tmp_path / "run", FEW)
    monkeypatch.setattr(scripts, "conditions", lambda: {"source": "another"})
    with pytest.warns(UserWarning, match="code or packages have changed since the run: the fields at 0.1 h may differ"):
        results.fields(0.1)


def test_a_run_reaches_beyond_its_rows():
    """To the end of its scene, and back to t = 0."""
    inner = repro.solve("base", {**FEW, "output.times": ["0.3 h"]})
    for time in (0, 0.1, 0.55, 0.6):
        assert same_arrays(inner.fields(time), solved("fast", more=True).fields(time))


def test_a_profile_is_the_field_along_a_line():
    """A linear function of the places is met to round-off, in curved triangles too; ends lie on the walls."""
    results = solved("fast")
    fields = results.fields(0.6)
    x, along = results.profile("acceptor", y="20 um", time=0.6, points=31)
    y, across = results.profile("acceptor", x=10, time="36 min", points=26)
    assert x[[0, -1]].tolist() == [fields["places_um"][:, 0].min(), fields["places_um"][:, 0].max()]
    assert y.tolist() == np.linspace(0, 50, 26).tolist() and y[10] == 20
    at = np.interp(10, x, along)
    assert across[10] == pytest.approx(at, rel=1e-4)
    places = dict(fields, acceptor_mg_per_L=fields["places_um"] @ [2, 3])
    linear = repro.Results("x", [dict.fromkeys(COLUMNS) | {"time_h": 0.0}], [places], "completed")
    x, values = linear.profile("acceptor", y=20, time=0)
    assert values == pytest.approx(2 * x + 60, rel=1e-12)


def test_a_field_of_triangles_and_one_of_the_aggregate_have_their_own_values():
    results = solved("fast")
    y, region = results.profile("region", x=0, time=0.6, points=101)
    thickness = results["thickness_um"][-1]
    assert region.tolist() == [1.0 if place < thickness else 0.0 for place in y]
    _, J = results.profile("J", x=0, time=0.6, points=101)
    assert (np.isfinite(J) == (region == 1)).all()
    assert results.profile("velocity", x=0, time=0.6)[1].shape == (201, 3)


def test_a_probe_follows_a_place_over_the_rows():
    results = solved("fast")
    values = results.probe("acceptor", x="1 um", y="20 um")
    each = [results.profile("acceptor", x=1, time=time, points=6)[1][2] for time in results.time]
    assert values == pytest.approx(each, rel=1e-12) and values[0] > values[-1]
    assert np.isnan(results.probe("acceptor", x=250, y=20)).all(), "beside the meshed part"


@pytest.mark.parametrize("call, error, message", [
    (lambda results: results.probe("acceptor", x=301, y=20), ValueError,
     "x: 301 um is outside the pore, from -300 to 300 um"),
    (lambda results: results.probe("acceptor", x=0, y="-1 um"), ValueError,
     "y: -1 um is outside the pore, from 0 to 50 um"),
    (lambda results: results.profile("acceptor", y="51 um", time=0), ValueError, "y: 51 um is outside the pore"),
    (lambda results: results.profile("acceptor", y="5 h", time=0), ValueError, "y: '5 h': a number of um or a text"),
    (lambda results: results.profile("acceptor", time=0), ValueError, "profile: one of x and y, and two points"),
    (lambda results: results.profile("acceptor", x=0, y=0, time=0), ValueError, "profile: one of x and y"),
    (lambda results: results.profile("acceptr", x=0, time=0), KeyError, "acceptr: this run has no such"),
    (lambda results: results.probe("acceptr", x=0, y=0), KeyError, "acceptr: this run has no such column or field"),
    (lambda results: results.to_xarray(["acceptr"]), KeyError, "acceptr: this run has no such column or field")])
def test_a_place_outside_the_pore_is_refused(call, error, message):
    with pytest.raises(error, match=message):
        call(solved("fast"))


def test_a_dataset_has_fields_on_a_grid():
    """With the values of profiles, units and words."""
    pytest.importorskip("xarray")
    results = solved("fast")
    dataset = results.to_xarray(["acceptor", "velocity_m_per_d", "theta"], across=26)
    assert dataset["acceptor_mg_per_L"].dims == ("time_h", "y_um", "x_um")
    assert dataset["velocity_m_per_d"].dims == ("time_h", "y_um", "x_um", "axis")
    assert dataset["acceptor_mg_per_L"].attrs == {"units": "mg L-1", "long_name": "acceptor"}
    row = dataset["acceptor_mg_per_L"].sel(time_h=0.3, y_um=20)
    x, values = results.profile("acceptor", y=20, time=0.3, points=len(row))
    assert row["x_um"].values == pytest.approx(x) and row.values == pytest.approx(values, rel=1e-9)
    assert np.diff(dataset["x_um"]) == pytest.approx(2.0, rel=0.02) and dataset["y_um"].values[1] == 2
    assert results.to_xarray().identical(results.to_xarray([]))
    assert set(results.to_xarray()) < set(dataset)
