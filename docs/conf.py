"""The site: `make docs` builds it from the repository's pages into docs/_build/html.

The source folder is the repository, so that a link between two pages is the same in a checkout and on the site.
"""

import os
import sys
from importlib.util import find_spec
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / "docs" / "site")]
os.environ["PYTHONPATH"] = str(ROOT)
os.environ.pop("MPLBACKEND", None)  # notebooks show their figures inline

#: Browsers need a font with mathematical metrics for brackets and integrals that fit their contents.
MATHEMATICS_FONT = Path(find_spec("ziamath").origin).with_name("fonts") / "STIXTwoMath-Regular.ttf"

project = "dupin2001-repro"
author = "the dupin2001-repro authors"
copyright = f"2026, {author}"
root_doc = "docs/index"
include_patterns = [
    "README.md", "CHANGELOG.md", "CONTRIBUTING.md", "docs/**.md", "docs/examples/*.py", "paper_figures/replication.md",
    "paper_figures/register.md", "reference/ERRATA.md", "verification/report/*.md",
    "verification/sensitivity/sensitivity.md",
    "build/cases/*.md",  # generated when the build begins
]
#: Of build/, cases alone has sources.
exclude_patterns = ["docs/_build", "build/[!c]*", "build/crate", "**/.*"]
extensions = [
    "myst_nb", "sphinx.ext.autodoc", "sphinx.ext.autosummary", "numpydoc", "sphinx_design",
    "mathml", "citations", "times", "case_sources", "scene_keys", "film", "figure_runs",  # in docs/site
]
source_suffix = {".md": "myst-nb", ".py": "myst-nb"}
nb_custom_formats = {".py": ["jupytext.reads", {"fmt": "py:percent"}]}
myst_enable_extensions = ["dollarmath", "colon_fence", "deflist"]
myst_heading_anchors = 4
myst_title_to_header = True
smartquotes = False  # values of keys are copied from pages
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 600  # s of wall time: a loaded machine may stall
numpydoc_show_class_members = False
autodoc_typehints = "none"

html_theme = "furo"
html_title = "Biological clogging of a pore, reproduced"
html_static_path = ["site/static", str(MATHEMATICS_FONT)]
html_css_files = ["site.css"]
html_js_files = ["tables.js"]
html_domain_indices = False
html_copy_source = False
html_show_sourcelink = False
html_additional_pages = {"index": "redirect.html"}
templates_path = ["site/templates"]
