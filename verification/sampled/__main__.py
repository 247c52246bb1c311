"""Mutants made by machine: ``python -m verification.sampled``, see :mod:`verification.sampled`."""

import sys

from verification.sampled.driver import main

if __name__ == "__main__":
    sys.exit(main())
