"""The preset exact against the independent solver of the whole base run."""

from __future__ import annotations

from reference import whole_run
from verification.case import Outcome, at_most, case
from verification.coupling import presets


@case("coupling-exact", kind="cross-code", slow=True, norm="as coupling-presets",
      claim="Each of the eight numbers of base is within 0.01 % with preset exact",
      mutants=("exact-steps-of-accurate",))
def exact() -> Outcome:
    theirs, error = presets._reference()
    apart = presets._apart(presets._listed("exact"), theirs)
    checks = [at_most("the reference itself", error, 5e-5, "half of what is asked")]
    return Outcome((*checks, *(at_most(name, value, 1e-4, "what the preset is for")
                               for name, value in zip(whole_run.NAMES, apart))))
