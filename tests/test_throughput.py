"""What `python -m verification.throughput` judges; that it holds is for an idle machine to tell."""

import pytest

from verification import throughput


@pytest.mark.parametrize("ratios, status", [((0.95, 0.2, 0.91), 0), ((0.89, 0.99, 0.85), 1)])
def test_the_median_is_judged(monkeypatch, capsys, ratios, status):
    """Mutants: the best or the last repeat judged; always zero."""
    found = iter(ratios)
    monkeypatch.setattr(throughput, "measure", lambda count: (next(found), 1.0))
    assert throughput.main(["--repeats", "3"]) == status
    assert ("does not hold" in capsys.readouterr().out) == bool(status)


def test_a_sweep_that_fails_has_no_rate(monkeypatch, tmp_path):
    monkeypatch.setattr(throughput, "repro", lambda arguments: 3)
    with pytest.raises(RuntimeError, match="status 3"):
        throughput.swept(4, tmp_path)
