"""Wrong changes to the bounded transfer that cases of this stage must catch."""

from verification.mutants import Mutant

BOUNDED = (
    Mutant("bounded-lumped", "repro/fem/transfer.py",
           says="Wherever a bound is exceeded the transfer falls back to the lumped projection everywhere.",
           old="flux = coupling * (found[ends[:, 0], column] - found[ends[:, 1], column])",
           new="flux = 0 * coupling"),
    Mutant("bounded-unlimited", "repro/fem/transfer.py",
           says="The fluxes are not limited; what is out of bounds is cut off, with its mass.",
           old="np.minimum(1.0, r / np.where(p > 0, p, 1.0))",
           new="np.minimum(1.0, 1 + r / np.where(p > 0, p, 1.0))"),
    Mutant("bounded-one-sided", "repro/fem/transfer.py",
           says="A flux is limited by the node that it enters alone: the node that it leaves falls below its bound.",
           old="part = np.where(flux > 0, forward, backward) * flux",
           new="part = np.where(flux > 0, up[first], up[second]) * flux"),
    Mutant("bounds-of-one-piece", "repro/fem/transfer.py",
           says="The bounds of a node are those of the last common piece that touches it.",
           old="        np.maximum.at(most, corner, values.max(axis=1))\n",
           new="        most[corner] = values.max(axis=1)\n"),
)
