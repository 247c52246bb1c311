"""The pages of the verification cases, which are generated before Sphinx looks for its sources."""

from pathlib import Path

from verification.evidence import case_pages


def write_pages(app) -> None:
    """Write the pages into build/cases."""
    case_pages.write(Path(app.srcdir, "build", "cases"))


def setup(app) -> dict:
    """Register the generator."""
    app.connect("builder-inited", write_pages)
    return {"parallel_read_safe": True}
