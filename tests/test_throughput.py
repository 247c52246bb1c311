"""What `python -m verification.throughput` judges; that it holds is for an idle machine to tell."""

import pytest

from verification import throughput


@pytest.mark.parametrize("ratios, status", [((0.95, 0.2, 0.91), 0), ((0.89, 0.99, 0.85), 1)])
def test_the_median_is_judged(monkeypatch, capsys, ratios, status):
    """Mutants: the best or the last repeat judged; the other preset; always zero."""
    found = {throughput.JUDGED: iter(ratios), throughput.TOLD: iter([0.9 if status else 0.1] * 3)}
    monkeypatch.setattr(throughput, "measure", lambda preset, count: next(found[preset]))
    assert throughput.main(["--repeats", "3"]) == status
    assert ("does not hold" in capsys.readouterr().out) == bool(status)


def test_a_sweep_that_fails_has_no_rate(monkeypatch, tmp_path):
    monkeypatch.setattr(throughput, "repro", lambda arguments: 3)
    with pytest.raises(RuntimeError, match="status 3"):
        throughput.swept("fast", 4, tmp_path)
