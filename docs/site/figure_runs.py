"""The runs of the figures, computed when a build begins: on a busy machine they take longer than a page may, 600 s."""

from importlib import import_module

from paper_figures import FIGURES, runs


def compute_runs(app) -> None:
    """Compute missing runs into paper_figures/cache."""
    modules = [import_module(f"paper_figures.{name}") for name in FIGURES]
    runs.folders(dict.fromkeys(request for module in modules for request in module.RUNS))


def setup(app) -> dict:
    """Register the runs."""
    app.connect("builder-inited", compute_runs)
    return {"parallel_read_safe": True}
