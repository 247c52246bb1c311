"""The film of the paper's pore on the first page, made when a build begins."""

from pathlib import Path

import repro


def make_film(app) -> None:
    """Write the acceptor in the pore of base, a picture per half an hour, into build/film."""
    file = Path(app.srcdir, "build", "film", "base.gif")
    if not file.exists():
        file.parent.mkdir(parents=True, exist_ok=True)
        repro.solve("base", ['numerics.preset="fast"', 'output.every="0.5 h"']).animate("acceptor", file)


def setup(app) -> dict:
    """Register the film."""
    app.connect("builder-inited", make_film)
    return {"parallel_read_safe": True}
