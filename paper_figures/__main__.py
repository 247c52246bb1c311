"""`python -m paper_figures`: run what is not cached, draw every figure into `paper_figures/out`, write a page."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from time import perf_counter

from paper_figures import FIGURES, page, runs, style
from repro.cache import provenance

OUT = Path(__file__).parent / "out"


def main() -> None:
    """All figures; one line each."""
    modules = {name: import_module(f"paper_figures.{name}") for name in FIGURES}
    requests = list(dict.fromkeys(request for module in modules.values() for request in module.RUNS))
    found = _computed(requests)
    entries = [_drawn(name, module, found) for name, module in modules.items()]
    page.write(entries, [f"{request.scene}: {provenance(folder)['status']}" for request, folder in found.items()], OUT)
    print(f"{OUT / 'index.html'}: all of them with captions", flush=True)


def _computed(requests: list[runs.Request]) -> dict[runs.Request, Path]:
    """Results folder of each request."""
    start = perf_counter()
    print(f"runs: {', '.join(request.scene for request in requests)} ...", end=" ", flush=True)
    found = dict(zip(requests, runs.folders(requests)))
    print(f"ready after {perf_counter() - start:.0f} s", flush=True)
    return found


def _drawn(name: str, module, found: dict[runs.Request, Path]) -> page.Entry:
    """Draw one figure and say what the page tells about it."""
    folders = [found[request] for request in module.RUNS]
    style.save(module.draw(*folders), OUT, name)
    print(f"{name}: {module.TITLE}", flush=True)
    return page.Entry(name, module.TITLE, module.caption(*folders), tuple(r.command() for r in module.RUNS),
                      module.CLAIMS)


if __name__ == "__main__":
    main()
