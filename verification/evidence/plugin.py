"""The plugin of pytest: the fixture ``record``, the verdict of a case, and the records of a whole session.

Cases call ``record`` with their checks and studies, and fail at their end if one of these does not hold. What is
recorded travels with the reports of pytest, so that the records of parallel workers come together by themselves. At the
end of a session ``report/live/measured.json`` holds the numbers of the cases that ran; with ``--pages`` their pages are
written anew, and all other pages stay as recorded.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from verification.evidence import cases, pages, results
from verification.evidence.checks import Check, Study, flat
from verification.evidence.results import Result

RECORDED = pytest.StashKey[list[Check | Study]]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """``--pages``."""
    parser.addoption("--pages", action="store_true", help="write the pages of the verification cases that run")


def pytest_configure(config: pytest.Config) -> None:
    """Records come together in the process that all workers report to."""
    if not hasattr(config, "workerinput"):
        config.pluginmanager.register(Session(config))


def pytest_itemcollected(item: pytest.Item) -> None:
    """A report says which variant of which case it is of, and ``-k`` knows the id. Cases turn no warning into an error,
    because references use packages of others."""
    mark = item.get_closest_marker("case")
    if mark:
        id = mark.args[0]
        label = cases.label_of(id, item.callspec.id) if hasattr(item, "callspec") else ""
        item.user_properties += [("case", id), ("variant", label)]
        item.extra_keyword_matches.add(id)
        item.add_marker(pytest.mark.filterwarnings("default"))


@pytest.fixture
def record(request: pytest.FixtureRequest) -> Callable:
    """Record checks and studies, single ones or nested lists or generators of them."""
    recorded = request.node.stash.setdefault(RECORDED, [])
    return lambda *evidence: recorded.extend(flat(evidence))


@pytest.hookimpl(wrapper=True)
def pytest_pyfunc_call(pyfuncitem: pytest.Function):
    """Run a case with floating-point errors raised. It fails unless it records something and all of that holds."""
    with np.errstate(all="raise", under="ignore"):
        outcome = yield
    if pyfuncitem.get_closest_marker("case"):
        recorded = pyfuncitem.stash.get(RECORDED, [])
        pyfuncitem.user_properties.append(("evidence", [results.as_row(part) for part in recorded]))
        short = "\n".join(results.shortfall(part) for part in recorded if not part.holds)
        if short or not recorded:
            pytest.fail(short or "nothing was measured", pytrace=False)
    return outcome


class Session:
    """The results of all cases that run in a session, whichever workers run them."""

    def __init__(self, config: pytest.Config):
        self.pages = config.getoption("pages", False)
        self.results: dict[str, Result] = {}

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """A case has run, or one of its fixtures has failed."""
        properties = dict(report.user_properties)
        if "case" in properties and (report.when == "call" or report.failed):
            self.results.setdefault(properties["case"], Result(properties["case"])).add(report)

    def pytest_sessionfinish(self) -> None:
        """Write the records of what ran."""
        if self.results:
            results.save_measured(self.results.values())
        if self.results and self.pages:
            pages.write(self.results.values())
