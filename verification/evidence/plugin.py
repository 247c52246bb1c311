"""The plugin of pytest: the fixture ``record``, the verdict of a case, and the records of a whole session.

Cases call ``record`` with their checks and studies, and fail at their end if one of these does not hold. The
reports of pytest carry the evidence from parallel workers to the main process. At the end of a session,
``report/live/measured.json`` has the numbers of the cases that ran. With ``--pages`` the plugin rewrites their pages.
"""

from collections.abc import Callable

import numpy as np
import pytest

from verification.evidence import cases, pages, results
from verification.evidence.checks import Check, Study, flat
from verification.evidence.results import Result

RECORDED = pytest.StashKey[list[Check | Study]]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option ``--pages``."""
    parser.addoption("--pages", action="store_true", help="write the pages of the verification cases that run")


def pytest_configure(config: pytest.Config) -> None:
    """Collect the records in the process that all workers report to."""
    if not hasattr(config, "workerinput"):
        config.pluginmanager.register(Session(config))


def pytest_itemcollected(item: pytest.Item) -> None:
    """Add case and variant to the report, and the id to the keywords of ``-k``.

    Warnings do not fail a case, because references use other packages.
    """
    mark = item.get_closest_marker("case")
    if mark:
        id = mark.args[0]
        label = cases.label_of(id, item.callspec.id) if hasattr(item, "callspec") else ""
        item.user_properties += [("case", id), ("variant", label)]
        item.extra_keyword_matches.add(id)
        item.add_marker(pytest.mark.filterwarnings("default"))


@pytest.fixture
def record(request: pytest.FixtureRequest) -> Callable:
    """Return the function that records the checks and studies of a case.

    The case fails at its end unless it recorded evidence and all of it holds.

    Parameters
    ----------
    request : pytest.FixtureRequest
        The request of pytest, which names the test.

    Returns
    -------
    callable
        ``record(*evidence)`` takes Checks and Studies, single ones or nested lists or generators of them.

    Examples
    --------
    A case takes the fixture as an argument. A list replaces it here:

    >>> from verification.evidence.checks import at_most
    >>> def test_plug(record):
    ...     record(at_most("velocity", 2e-4, 1e-3, "a tenth of the error of the preset fast"))
    >>> recorded = []
    >>> test_plug(recorded.append)
    >>> [check.holds for check in recorded]
    [True]
    """
    recorded = request.node.stash.setdefault(RECORDED, [])
    return lambda *evidence: recorded.extend(flat(evidence))


@pytest.hookimpl(wrapper=True)
def pytest_pyfunc_call(pyfuncitem: pytest.Function):
    """Run a case with floating-point errors raised. The case fails unless it records evidence and all of it holds."""
    with np.errstate(all="raise", under="ignore"):
        outcome = yield
    if pyfuncitem.get_closest_marker("case"):
        recorded = pyfuncitem.stash.get(RECORDED, [])
        pyfuncitem.user_properties.append(("evidence", [results.as_row(part) for part in recorded]))
        failures = "\n".join(results.shortfall(part) for part in recorded if not part.holds)
        if failures or not recorded:
            pytest.fail(failures or "nothing was measured", pytrace=False)
    return outcome


class Session:
    """The results of all cases of a session, from all workers."""

    def __init__(self, config: pytest.Config):
        self.pages = config.getoption("pages", False)
        self.results: dict[str, Result] = {}

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Collect a case that ran, or whose fixture failed."""
        properties = dict(report.user_properties)
        if "case" in properties and (report.when == "call" or report.failed):
            self.results.setdefault(properties["case"], Result(properties["case"])).add(report)

    def pytest_sessionfinish(self) -> None:
        """Write the records of the cases that ran."""
        if self.results:
            results.save_measured(self.results.values())
        if self.results and self.pages:
            pages.write(self.results.values())
