"""Run the verification: ``python -m verification``, see :mod:`verification.kernel.driver`."""

import sys

from verification import hard_cases
from verification.kernel.driver import main

if __name__ == "__main__":
    sys.exit(main(writers=(hard_cases.record,)))
