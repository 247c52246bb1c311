"""Run mutants: ``python -m verification.mutants [ID ...]``, see :mod:`verification.mutants.runner`."""

import sys

from verification.mutants.runner import main

if __name__ == "__main__":
    sys.exit(main())
