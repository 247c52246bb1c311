"""`python -m paper_figures`: compute missing runs, draw every figure into `paper_figures/out`, write a page."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from time import perf_counter

from paper_figures import FIGURES, manifest, page, runs, style
from repro.results import write_json
from verification.store import provenance

OUT = Path(__file__).parent / "out"


def main() -> None:
    """Draw all figures and print a line for each."""
    modules = {name: import_module(f"paper_figures.{name}") for name in FIGURES}
    requests = list(dict.fromkeys(request for module in modules.values() for request in module.RUNS))
    folders = _compute_runs(requests)
    drawn = {name: _draw_figure(name, module, folders) for name, module in modules.items()}
    entries = [entry for entry, _ in drawn.values()]
    page.write(entries, [f"{request.name}: {provenance(folder)['status']}" for request, folder in folders.items()], OUT)
    write_json(OUT / manifest.NAME, {
        "environment": manifest.environment(),
        "runs": {request.name: manifest.of_run(request, folder) for request, folder in folders.items()},
        "figures": {name: figure for name, (_, figure) in drawn.items()}})
    print(f"{OUT / 'index.html'}: all figures with captions; {manifest.NAME}: hashes of their data", flush=True)


def _compute_runs(requests: list[runs.Request]) -> dict[runs.Request, Path]:
    """The folder of each request's run."""
    start = perf_counter()
    print(f"runs: {', '.join(request.name for request in requests)} ...", end=" ", flush=True)
    folders = dict(zip(requests, runs.folders(requests)))
    print(f"ready after {perf_counter() - start:.0f} s", flush=True)
    return folders


def _draw_figure(name: str, module, folders_of_requests: dict[runs.Request, Path]) -> tuple[page.Entry, dict]:
    """Draw one figure; return its entries in the page and in the manifest."""
    start = perf_counter()
    folders = [folders_of_requests[request] for request in module.RUNS]
    figure = module.draw(*folders)
    caption = module.caption(*folders)
    data = manifest.figure_hash(figure, caption)
    style.save(figure, OUT, name)
    print(f"{name}: {module.TITLE}", flush=True)
    commands = (*(request.command() for request in module.RUNS), *page.commands_of_claims(module))
    return (page.Entry(name, module.TITLE, caption, commands, module.CLAIMS),
            manifest.of_figure(module, data, perf_counter() - start, OUT.glob(f"{name}.*")))


if __name__ == "__main__":
    main()
