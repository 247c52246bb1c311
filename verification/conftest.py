"""The verification is a suite of pytest; see :mod:`verification.evidence.plugin`."""

from verification.evidence.plugin import (  # noqa: F401
    pytest_addoption,
    pytest_configure,
    pytest_itemcollected,
    pytest_pyfunc_call,
    record,
)
