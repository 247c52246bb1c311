"""Check of the arguments of the laws for networks."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

#: The name of A / W^2 in messages.
SHARE = "area / width^2"


def area_share(area: np.ndarray, width: np.ndarray) -> np.ndarray:
    """Return A / W^2 of (...) throats; not-a-number where the width is not positive."""
    return area / np.where(width > 0, width, np.nan)**2


class Check(NamedTuple):
    """Check of a law's arguments. law: the name of its function; outside: as in the law."""

    law: str
    outside: str

    def within(self, name: str, values: ArrayLike, low: float, high: float,
               where: ArrayLike = True) -> np.ndarray:
        """Return where values are in a range or need no check."""
        values = np.asarray(values, float)
        is_known = (values >= low) & (values <= high) | ~np.asarray(where)
        return self._checked(name, values, is_known, f"{low:.4g} to {high:.4g}")

    def positive(self, name: str, values: np.ndarray) -> np.ndarray:
        """Return where values are more than zero and finite."""
        return self._checked(name, values, (values > 0) & np.isfinite(values), "more than zero")

    def _checked(self, name: str, values: np.ndarray, is_known: np.ndarray,
                 accepted: str) -> np.ndarray:
        """Return ``is_known``. Raises ValueError for the first value that is not known."""
        if self.outside not in ("raise", "nan"):
            raise ValueError(f"{self.law}: outside = {self.outside!r} is not known; "
                             "'raise' or 'nan' is accepted")
        if self.outside == "raise" and not is_known.all():
            index = tuple(map(int, np.argwhere(~is_known)[0]))
            throat = f"throat {', '.join(map(str, index))}: " if index else ""
            raise ValueError(f"{self.law}: {throat}{name} = {values[index]:.6g} is not known; "
                             f"{accepted} is accepted")
        return is_known
