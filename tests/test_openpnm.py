"""The example of a network with OpenPNM runs, and its own checks hold."""
import runpy

import pytest

from tests.blocks import ROOT


def test_the_network_of_openpnm_runs():
    """It asserts the balances of water and of both substrates at each time."""
    pytest.importorskip("openpnm", reason="OpenPNM is not installed here; make network installs it and runs this test")
    runpy.run_path(str(ROOT / "docs" / "howto" / "openpnm_network.py"))
