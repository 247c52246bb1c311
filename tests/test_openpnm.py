"""The example of a network with OpenPNM."""
import runpy

import numpy as np
import pytest

from tests.blocks import ROOT


def test_growth_reduces_the_flow_of_100_throats():
    """The flow falls in every step. The example itself asserts its balances of water and of both substrates."""
    pytest.importorskip("openpnm", reason="OpenPNM is not installed here; make network installs it and runs this test")
    example = runpy.run_path(str(ROOT / "docs" / "howto" / "openpnm_network.py"))
    assert len(example["throats"]) == 100 and len(example["total"]) == 25
    assert (np.diff(example["total"]) < 0).all()
