"""Wrong changes that cases must catch: ``python -m verification.mutants``, see :mod:`verification.kernel.mutants`."""

import sys

from verification.kernel.mutants import main

if __name__ == "__main__":
    sys.exit(main())
