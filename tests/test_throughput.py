"""What `python -m verification.throughput` judges; that it holds is for an idle machine to tell."""

import pytest

from verification import throughput


@pytest.mark.parametrize("ratios, status", [((0.99, 0.2, 0.96), 0), ((0.94, 0.99, 0.85), 1)])
def test_the_median_is_judged(monkeypatch, capsys, ratios, status):
    found = {throughput.JUDGED: iter(ratios), throughput.TOLD: iter([0.9 if status else 0.1] * 3)}
    monkeypatch.setattr(throughput, "measure", lambda preset, count: next(found[preset]))
    monkeypatch.setattr(throughput, "commands", lambda: {})
    assert throughput.main(["--repeats", "3"]) == status
    assert ("does not hold" in capsys.readouterr().out) == bool(status)


@pytest.mark.parametrize("slow, status", [(1.0, 0), (1.35, 1)])
def test_a_command_that_costs_too_much_is_told(monkeypatch, capsys, slow, status):
    """By its time over that of the imports and of a warm run."""
    monkeypatch.setattr(throughput, "measure", lambda preset, count: 0.99)
    monkeypatch.setattr(throughput, "warm", lambda preset, folder: 0.3)
    taken = {"-m": {"--help": 0.1, "run": 0.6 * slow}, "-c": {"numpy": 0.08, "all": 0.3}}

    def fresh(kind, asked, *rest):
        if kind == "-c":
            return taken["-c"]["numpy" if asked == "import numpy" else "all"]
        return taken["-m"][rest[0]]

    monkeypatch.setattr(throughput, "fresh", fresh)
    assert throughput.main(["--repeats", "1"]) == status
    out = capsys.readouterr().out
    assert f"repro run base in fast: {slow:.2f} times" in out and ("does not hold" in out) == bool(status)
    assert "repro --help: 1.25 times" in out


def test_a_sweep_that_fails_has_no_rate(monkeypatch, tmp_path):
    monkeypatch.setattr(throughput, "repro", lambda arguments: 3)
    with pytest.raises(RuntimeError, match="status 3"):
        throughput.swept("fast", 4, tmp_path)
