"""Laws of uptake: the fraction m(C) by which a substrate limits uptake and growth in (7)-(10).

A law is a subclass of :class:`UptakeLaw` and an entry of LAWS. It states m(C), dm/dC, the constants
that it takes from a substrate, and bounds. The rates (7)-(10), Newton's method, Gear's scheme and
`repro check` use it only through this class.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from typing import Any, TypeVar

import numpy as np

from repro.scene import Kinetics, Substrate, Substrates

#: A number, or an array of them: results have the same shape.
Values = TypeVar("Values", np.ndarray, float)

#: C = K s / (1 - s) is evaluated at this s where round-off makes s = C / (C + K) one.
LARGEST_SATURATION = 1 - np.finfo(float).eps


@dataclass(frozen=True, eq=False)
class UptakeLaw:
    """A law m(C) of one substrate, or of both at once.

    Parameters
    ----------
    half_saturation : float or (2, 1, 1) array
        K, mg/L. Uptake is proportional to C far below it.

    Notes
    -----
    Newton's method follows the saturation s = C / (C + K) in place of C. It rises from 0 to 1 with
    C for every law, so that a law need not be monotone.
    """

    half_saturation: Any

    @classmethod
    def constants(cls, substrate: Substrate) -> tuple[float, ...]:
        """The law's constants of a substrate, in the order of its fields."""
        return (substrate.half_saturation,)

    @classmethod
    def of(cls, *substrates: Substrate) -> UptakeLaw:
        """The law of several substrates at once; its constants are (k, 1, 1) arrays."""
        columns = zip(*map(cls.constants, substrates))
        return cls(*(np.array(column)[:, None, None] for column in columns))

    def __iter__(self) -> Iterator[UptakeLaw]:
        """The laws of the single substrates; their constants are numbers."""
        columns = [getattr(self, field.name).ravel().tolist() for field in fields(self)]
        return (type(self)(*constants) for constants in zip(*columns))

    def fraction(self, concentration: Values) -> Values:
        """m of max(C, 0), C in mg/L."""
        raise NotImplementedError

    def slope(self, concentration: Values) -> Values:
        """dm/dC of max(C, 0), L/mg."""
        raise NotImplementedError

    def largest(self, supply: float) -> float:
        """An upper bound of m for concentrations up to a supply (mg/L)."""
        raise NotImplementedError

    def saturates(self, supply: float) -> bool:
        """Is uptake nearly independent of C at the supply (mg/L)?"""
        raise NotImplementedError

    def extended(self, concentration: Values) -> tuple[Values, Values]:
        """m and dm/dC; below zero m continues along its tangent at zero."""
        slope = self.slope(concentration)
        return self.fraction(concentration) + np.minimum(concentration, 0.0) * slope, slope

    def proportional(self, concentration: Values) -> Values:
        """C / K, the tangent at zero of m and of the saturation."""
        return concentration / self.half_saturation

    def saturation(self, concentration: Values) -> Values:
        """s = C / (C + K) of max(C, 0)."""
        positive = np.maximum(concentration, 0.0)
        return positive / (positive + self.half_saturation)

    def saturation_slope(self, saturation: Values) -> Values:
        """ds/dC = (1 - s)^2 / K, L/mg."""
        return (1 - saturation) ** 2 / self.half_saturation

    def concentration(self, saturation: Values) -> Values:
        """C = K s / (1 - s), mg/L, for s up to LARGEST_SATURATION."""
        return self.half_saturation * saturation / (1 - saturation)

    def at_saturation(self, saturation: Values) -> tuple[Values, Values | float]:
        """m and dm/ds at a saturation."""
        bounded = np.minimum(saturation, LARGEST_SATURATION)
        concentration = self.concentration(bounded)
        slope = self.slope(concentration) / self.saturation_slope(bounded)
        return self.fraction(concentration), slope

    def sharpness(self, supply: Values) -> Values:
        """The part of the supply (mg/L) over which uptake falls to zero: K / supply, at most 1.
        """
        return self.half_saturation / np.maximum(supply, self.half_saturation)

    def softened(self, factor: float, supply: Values) -> UptakeLaw:
        """The law with K larger by a factor, up to the supply (mg/L)."""
        larger = np.minimum(factor * self.half_saturation, supply)
        return replace(self, half_saturation=np.maximum(self.half_saturation, larger))


class Monod(UptakeLaw):
    """Monod's law, m = C / (C + K): the fraction is the saturation itself."""

    def fraction(self, concentration: Values) -> Values:
        """C / (C + K)."""
        return self.saturation(concentration)

    def slope(self, concentration: Values) -> Values:
        """K / (C + K)^2."""
        return self.half_saturation / (np.maximum(concentration, 0.0) + self.half_saturation) ** 2

    def largest(self, supply: float) -> float:
        """One, for any supply."""
        return 1.0

    def saturates(self, supply: float) -> bool:
        """True for a supply above K."""
        return supply > self.half_saturation

    def at_saturation(self, saturation: Values) -> tuple[Values, float]:
        """m = s."""
        return saturation, 1.0


#: Laws by the values of `kinetics.law`.
LAWS: dict[str, type[UptakeLaw]] = {"dual Monod": Monod}


def uptake_law(substrates: Substrates, kinetics: Kinetics) -> UptakeLaw:
    """A scene's law of uptake of acceptor and donor."""
    return LAWS[kinetics.law].of(substrates.acceptor, substrates.donor)
