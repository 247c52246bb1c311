"""`python -m paper_figures`: run what is not cached, draw every figure into `paper_figures/out`, write a page."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from time import perf_counter

from paper_figures import FIGURES, manifest, page, runs, style
from repro.results import write_json
from verification.store import provenance

OUT = Path(__file__).parent / "out"


def main() -> None:
    """All figures; one line each."""
    modules = {name: import_module(f"paper_figures.{name}") for name in FIGURES}
    requests = list(dict.fromkeys(request for module in modules.values() for request in module.RUNS))
    found = _computed(requests)
    told = {name: _drawn(name, module, found) for name, module in modules.items()}
    entries = [entry for entry, _ in told.values()]
    page.write(entries, [f"{request.name}: {provenance(folder)['status']}" for request, folder in found.items()], OUT)
    write_json(OUT / manifest.NAME, {
        "environment": manifest.environment(),
        "runs": {request.name: manifest.of_run(request, folder) for request, folder in found.items()},
        "figures": {name: figure for name, (_, figure) in told.items()}})
    print(f"{OUT / 'index.html'}: all of them with captions; {manifest.NAME}: hashes of their data", flush=True)


def _computed(requests: list[runs.Request]) -> dict[runs.Request, Path]:
    """Results folder of each request."""
    start = perf_counter()
    print(f"runs: {', '.join(request.name for request in requests)} ...", end=" ", flush=True)
    found = dict(zip(requests, runs.folders(requests)))
    print(f"ready after {perf_counter() - start:.0f} s", flush=True)
    return found


def _drawn(name: str, module, found: dict[runs.Request, Path]) -> tuple[page.Entry, dict]:
    """Draw one figure; what the page and what the manifest tell about it."""
    start, folders = perf_counter(), [found[request] for request in module.RUNS]
    made, caption = module.draw(*folders), module.caption(*folders)
    data = manifest.figure_hash(made, caption)
    style.save(made, OUT, name)
    print(f"{name}: {module.TITLE}", flush=True)
    commands = (*(request.command() for request in module.RUNS), *page.also(module))
    return (page.Entry(name, module.TITLE, caption, commands, module.CLAIMS),
            manifest.of_figure(module, data, perf_counter() - start, OUT.glob(f"{name}.*")))


if __name__ == "__main__":
    main()
