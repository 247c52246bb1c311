"""A line at the end of the build: how long the notebooks took, and the tutorials among them."""

from myst_nb.sphinx_ import NbMetadataCollector

NOTEBOOKS = "docs/examples/"
#: A recipe of how-to; the other notebooks are tutorials.
RECIPES = {"docs/examples/calibrate"}


def print_times(app, error: Exception | None) -> None:
    """Print the wall time of all cells of the pages, of this build or of the build that wrote them."""
    if error is None:
        seconds = {page: data["exec_data"]["runtime"] or 0.0
                   for page, data in NbMetadataCollector.get_doc_data(app.env).items() if data.get("exec_data")}
        tutorials = sum(time for page, time in seconds.items() if page.startswith(NOTEBOOKS) and page not in RECIPES)
        print(f"executed pages: {sum(seconds.values()):.0f} s, of which tutorials: {tutorials:.0f} s")


def setup(app) -> dict:
    """Register the report."""
    app.connect("build-finished", print_times)
    return {"parallel_read_safe": True}
