"""The oracles agree with answers that need no computer, and import nothing of the code that they judge."""
import math
from pathlib import Path

import pytest

from tests import oracles
from tests.test_architecture import top_level_imports


def test_the_oracles_import_nothing_of_repro():
    assert top_level_imports(Path(oracles.__file__).read_text(encoding="utf-8")) == {"math", "numpy"}


def test_rates_and_extent_of_the_paper():
    """Section 4: at 10 K_s of both, F3 / X_A = 10 / 11 (9.3 0.61 10 / 11 - 0.12) 1/d, a doubling time of 3.6 h. The
    extent is 110 um at first (C07), 210 um with a half-width of 30 um (C08), and at most the length of the pore."""
    F3 = oracles.rates(10.0, 10.0, 1.0, 1.0, 9.3, 0.61, 0.12, 0.8, 1.42, 1.52)[2]
    assert F3 == pytest.approx(4.579339, abs=1e-6) and 24 * math.log(2) / F3 == pytest.approx(3.6, abs=0.05)
    for radius, length, half in ((5.0, 600.0, 55.0), (30.0, 600.0, 105.0), (30.0, 80.0, 40.0)):
        assert oracles.extent([(-radius, 0.0), (radius, 0.0), (0.0, radius)], 50.0, length) == (-half, half)
