"""The example of a network with OpenPNM."""
import runpy

import numpy as np
import pytest

from repro.results import read_table
from tests.blocks import ROOT
from verification.network import histories


def test_growth_reduces_the_flow_of_100_throats():
    """The flow falls in every step, and the records of heads and supplies are those of the example, which itself
    asserts its balances of water and of both substrates."""
    pytest.importorskip("openpnm", reason="OpenPNM is not installed here; make network installs it and runs this test")
    example = runpy.run_path(str(ROOT / "docs" / "howto" / "openpnm_network.py"))
    assert len(example["throats"]) == 100 and len(example["total"]) == 25
    assert (np.diff(example["total"]) < 0).all()
    for table, rows in ((histories.TABLE, histories.rows(example)), (histories.FLOWS, histories.flows(example))):
        recorded = np.array(list(read_table(table).values())).T
        assert recorded == pytest.approx(np.array(rows, float), rel=1e-5, abs=1e-6)
