"""The site in a real browser: pages load nothing from elsewhere, and search, tables, keys and widths work.

`make docs` builds it; without a build or a browser these tests are skipped.
"""

import re
import time
from functools import cache
from urllib.parse import quote_plus

import pytest

from paper_figures import FIGURES
from tests import browser
from tests.blocks import ROOT
from tests.test_published import QUESTIONS

SITE = ROOT / "docs" / "_build" / "html"
PAGES = sorted(path for path in SITE.rglob("*.html") if "_static" not in path.parts and path != SITE / "index.html")
CASES = SITE / "verification" / "report" / "REPORT.html"
pytestmark = [pytest.mark.thorough, pytest.mark.skipif(browser.CHROMIUM is None, reason="Chromium is not installed"),
              pytest.mark.skipif(not PAGES, reason="make docs has built no site")]


def wait_for(window, script):
    """Return the value of a script in the page as soon as it is true; fail after 20 s."""
    end = time.monotonic() + 20
    while not (value := window.attempt(script)):
        assert time.monotonic() < end, script
        time.sleep(0.05)
    return value


@pytest.mark.parametrize("width, dark", [(1200, False), (380, True)])
def test_every_page_opens_without_an_error_and_loads_nothing_from_elsewhere(window, width, dark):
    """No page is wider than its window, and it follows the dark mode of the system."""
    assert len(PAGES) > 40
    for page in PAGES:
        window.errors.clear()
        window.show(page, width=width, dark=dark)
        assert window.errors == [], page
        assert [url for url in window.requests if not url.startswith(("file:", "data:"))] == [], page
        window.check_look(width, dark)
        assert window.run("[...document.images].every(image => image.naturalWidth > 0 && image.alt)"), page
        assert not window.run("[...document.images].some(image => /[.](png|svg)$/.test(image.alt))"), page


@cache
def read_page(page):
    return page.read_text(encoding="utf-8")


def test_figures_are_pictures():
    """No cell prints the name of a figure in place of the figure."""
    for page in PAGES:
        assert "&lt;Figure size" not in read_page(page), page


def test_every_page_has_one_title():
    """The search page gets its title from a script."""
    for page in PAGES:
        assert read_page(page).count("<h1") == (page.name != "search.html"), page


def test_all_figures_have_a_picture_and_a_caption():
    page = read_page(SITE / "docs" / "figures.html")
    figures = re.findall(r'<figure id="(\w+)"><img alt="([^"]+)"[^>]*><figcaption>(.+?)</figcaption>', page, re.S)
    assert [name for name, _, _ in figures] == list(FIGURES)
    assert all(caption.startswith(f"<strong>{title}.</strong> ") for _, title, caption in figures)
    assert all(len(caption) > 200 for _, _, caption in figures)


def test_the_paper_has_links_to_its_references():
    page = read_page(SITE / "docs" / "paper.html")
    cited = set(re.findall(r"@(\w+)", read_page(ROOT / "docs" / "paper.md").partition("# Summary")[2]))
    assert len(cited) > 5 and "[@" not in page
    assert cited <= set(re.findall(r'href="#(\w+)"', page)) and all(f'id="{key}"' in page for key in cited)
    assert page.count("https://doi.org/") >= len(cited)


def test_the_root_leads_to_the_start(window):
    window.show(SITE / "index.html")
    assert wait_for(window, "location.pathname.endsWith('/docs/index.html')")


def test_the_search_finds_pages(window):
    window.show(SITE / "search.html", "?q=neo-Hookean")
    assert wait_for(window, "document.querySelectorAll('#search-results li a').length >= 2")
    for question in QUESTIONS:
        window.show(SITE / "search.html", f"?q={quote_plus(question)}")
        assert wait_for(window, "[...document.querySelectorAll('#search-results li a')]"
                                ".some(link => link.href.includes('questions.html'))"), question
    window.show(SITE / "search.html", "?q=zzzznothing")
    assert wait_for(window, "/did not match/.test(document.getElementById('search-results').innerText)")


ROWS = "[...document.querySelectorAll('article table')].at(-1).tBodies[0].rows"


def test_a_table_sorts_by_keys_and_filters_its_rows(window):
    """The table of cases: Enter on a heading sorts upwards and then downwards; each word of the filter must occur."""
    window.show(CASES)
    window.run("[...document.querySelectorAll('article table')].at(-1).tHead.rows[0].cells[3].focus()")
    numbers = f"[...{ROWS}].map(row => Number(row.cells[3].innerText))"
    for factor in (1, -1):
        window.press("Enter")
        values = [factor * value for value in window.run(numbers)]
        assert len(values) > 100 and values == sorted(values) and values[0] < values[-1]
    window.run("field = [...document.querySelectorAll('.table-filter')].at(-1);"
               "field.value = 'flow exact'; field.dispatchEvent(new Event('input'))")
    shown = window.run(f"[...{ROWS}].filter(row => row.offsetParent).map(row => row.innerText)")
    assert 3 < len(shown) < 50 and all("flow" in row and "exact" in row for row in shown)


def test_the_index_of_cases_has_menus(window):
    """Menus choose stage, kind, elements and equations; those that are chosen hold together with the field."""
    window.show(SITE / "build" / "cases" / "index.html")
    for menu, entry in (("stage", "flow"), ("kind", "exact"), ("elements and presets", "2"), ("equations", "(1)-(6)")):
        window.run(f"menu = document.querySelector('[aria-label=\"Choose {menu}\"]'); menu.value = '{entry}';"
                   "menu.dispatchEvent(new Event('input'))")
    shown = window.run(f"[...{ROWS}].filter(row => row.offsetParent)"
                       ".map(row => [...row.cells].slice(1, 5).map(cell => cell.innerText.trim()))")
    assert 1 < len(shown) < 20
    for stage, kind, elements, equations in shown:
        assert (stage, kind) == ("flow", "exact") and "2" in elements.split("; ") and "(1)-(6)" in equations


def test_the_keyboard_alone_opens_a_page(window):
    """Tab reaches, in turn, links with visible focus, the search, and a link of the contents; Enter opens it."""
    window.show(SITE / "docs" / "index.html")
    places = []
    for _ in range(40):
        window.press("Tab")
        places.append(window.run("document.activeElement.name || document.activeElement.getAttribute('href') || ''"))
        if places[-1].endswith("tutorial.html"):
            break
    assert "q" in places and places[-1].endswith("tutorial.html")
    assert window.run("getComputedStyle(document.activeElement).outlineStyle") != "none"
    window.press("Enter")
    assert wait_for(window, "location.pathname.endsWith('/docs/tutorial.html')")
