"""Scenes with other kinetics: one substrate alone, and decay without acceptor.

The case hard-family judges the files of runs with one substrate, and `test_longer.py` makes one of them longer.
"""

import numpy as np
import pytest

from repro import results
from repro.march.balance import LARGEST, Limits, accepted_demand, oxygen_demand
from repro.march.simulation import simulate
from repro.preflight.modelled import describe_model
from repro.scene import load_scene

SCHEMES = {"midpoint": ["numerics.preset=fast", 'growth.end="2 h"', 'output.times=["0 h", "2 h"]'],
           "updates": ["numerics.preset=paper", "numerics.refinement=0.5", 'growth.end="1 h"'],
           "gear": ["numerics.preset=paper", "numerics.refinement=0.5", "numerics.transport=gear",
                    'growth.end="0.4 h"']}
OTHER = {"acceptor": "donor", "donor": "acceptor"}


def demand_defects(scene, reports):
    """Of every step: the defect of the oxygen demand over the accepted one."""
    limits = Limits.of(scene)
    return [abs(oxygen_demand(scene.kinetics, ledger)) / accepted_demand(limits, ledger)
            for report in reports for ledger in report.ledgers]


@pytest.mark.parametrize("name, scheme", [
    pytest.param(name, scheme, marks=pytest.mark.thorough if (name, scheme) == ("acceptor", "midpoint") else ())
    for name in OTHER for scheme in SCHEMES])
def test_one_substrate_is_the_limit_of_an_excess_of_the_other(name, scheme):
    """The other one at 1e9 times its half saturation has m = 1 - 1e-9. The rows agree to 1e-7, and those of the absent
    one are empty. The oxygen demand closes, with the demand that the absent one would meet."""
    absent = OTHER[name]
    alone = load_scene("base", SCHEMES[scheme], unset=[f"substrates.{absent}"])
    excess = load_scene("base", [*SCHEMES[scheme], f'substrates.{absent}.supply="1e9 mg/L"'])
    reports = list(simulate(alone))
    row = results.row(alone, reports[-1])
    other = results.row(excess, list(simulate(excess))[-1])
    assert {key for key in row if row[key] is None} == {key for key in row if absent in key} | {
        key for key in other if other[key] is None}
    compared = ["conductivity_m_per_d", "aggregate_area_um2", "inert_fraction", f"{name}_min_mg_per_L",
                f"effluent_{name}_mg_per_L"]
    assert [row[key] for key in compared] == pytest.approx([other[key] for key in compared], rel=1e-7)
    assert max(demand_defects(alone, reports)) <= 1
    assert f"{absent}_mg_per_L" not in results.fields(alone, reports[-1].pore, reports[-1].solved).points


@pytest.mark.parametrize("scheme", SCHEMES)
def test_unlimited_decay_goes_on_without_acceptor(scheme):
    """Without a supply of acceptor nothing grows. With kinetics.decay unlimited X_A falls as exp(-b t), and 1 - f_d of
    that stays as X_I; its oxygen demand is unmet, and the demand closes. Decay with acceptor changes nothing."""
    starved = [*SCHEMES[scheme], 'substrates.acceptor.supply="0 mg/L"']
    scene = load_scene("base", [*starved, "kinetics.decay=unlimited"])
    reports = list(simulate(scene))
    b, f_d = scene.kinetics.decay_coefficient, scene.kinetics.degradable_fraction
    active = np.exp(-b * scene.growth.end)
    inert = (1 - f_d) * (1 - active)
    row = results.row(scene, reports[-1])
    first = results.row(scene, reports[0])
    steps = 1e-3 if scheme == "gear" else 1e-9  # Gear's first steps are of first order
    assert row["inert_fraction"] == pytest.approx(inert / (active + inert), rel=steps)
    lost = row["aggregate_area_um2"] / first["aggregate_area_um2"]
    assert lost == pytest.approx(active + inert, abs=1e-5)
    assert max(demand_defects(scene, reports)) <= 1 and row["acceptor_balance"] == pytest.approx(0, abs=LARGEST)
    unmet = sum(ledger.unmet[0] for report in reports for ledger in report.ledgers)
    degraded = reports[0].pore.mass * (1 - active) * f_d
    assert unmet == pytest.approx(scene.kinetics.decay_oxygen_demand * degraded, rel=max(steps, 1e-6))
    limited = list(simulate(load_scene("base", starved)))[-1]
    assert limited.pore.mass == reports[0].pore.mass and limited.pore.inert.sum() == 0


def test_check_states_what_is_assumed():
    """One substrate, several solutions, and decay; the paper's scene has its own decay and neither of the others."""
    changes = ["kinetics.law=Haldane", "kinetics.decay=unlimited"]
    changed = dict(describe_model(load_scene("base", changes, unset=["substrates.acceptor"])))
    paper = dict(describe_model(load_scene("base")))
    stated = {"one substrate: the other is assumed not to limit": "substrates", "of several solutions": "kinetics",
              "its oxygen demand is not met": "kinetics"}
    assert all(text in changed[section] and text not in paper[section] for text, section in stated.items())
    assert "none without acceptor" in paper["kinetics"]
