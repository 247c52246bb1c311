"""Wrong changes that cases or tests must catch: ``python -m verification.mutants``, of verification.kernel.mutants."""

import sys

from verification.kernel.mutants import main

if __name__ == "__main__":
    sys.exit(main())
