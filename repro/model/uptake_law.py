"""Laws of uptake: the fraction m(C) by which a substrate limits uptake and growth in (7)-(10).

A law is a subclass of :class:`UptakeLaw` and an entry of LAWS. It defines m(C), dm/dC, the
constants that it takes from a substrate, and bounds. The rates (7)-(10), Newton's method, Gear's
scheme and `repro check` use a law only through this class.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar, TypeVar

import numpy as np

from repro.scene import Kinetics, Substrate, Substrates

#: A number or an array; results have the same shape.
Values = TypeVar("Values", np.ndarray, float)

#: Largest s at which C = K s / (1 - s) is evaluated; round-off may make s = C / (C + K) one.
LARGEST_SATURATION = 1 - np.finfo(float).eps


@dataclass(frozen=True, eq=False)
class UptakeLaw:
    """A law m(C) of one substrate, or of both at once.

    Parameters
    ----------
    half_saturation : float or (2, 1, 1) array
        K, mg/L. For C far below K, uptake is proportional to C.

    Notes
    -----
    Newton's method uses the saturation s = C / (C + K) in place of C. For every law s increases
    from 0 to 1 with C, so a law need not be monotone.

    Examples
    --------
    >>> from repro.model.uptake_law import LAWS
    >>> law = LAWS["dual Monod"](half_saturation=1.0)
    >>> float(law.fraction(1.0)), float(law.slope(1.0))
    (0.5, 0.25)
    """

    half_saturation: Any

    #: Is m(C) nondecreasing? Otherwise several concentrations may be steady.
    monotone: ClassVar[bool] = True
    #: Is m(C) a step in the limit, so that the mesh determines K?
    sharp: ClassVar[bool] = False

    @classmethod
    def constants(cls, substrate: Substrate) -> tuple[float, ...]:
        """Return the law's constants of a substrate, in the order of the fields.

        Parameters
        ----------
        substrate : Substrate
            A substrate of the scene, with constants in mg/L.

        Returns
        -------
        tuple of float
            The half saturation K (mg/L). A subclass adds the values of its further fields, each in
            the unit of its key.

        Examples
        --------
        >>> import repro
        >>> from repro.model.uptake_law import Monod
        >>> Monod.constants(repro.load_scene("base").substrates.donor)
        (1.0,)
        """
        return (substrate.half_saturation,)

    @classmethod
    def of(cls, *substrates: Substrate) -> UptakeLaw:
        """Make one law for k substrates; its constants are (k, 1, 1) arrays."""
        columns = zip(*map(cls.constants, substrates))
        return cls(*(np.array(column)[:, None, None] for column in columns))

    def __iter__(self) -> Iterator[UptakeLaw]:
        """Iterate over the laws of the single substrates.

        Their constants are numbers, or arrays (r, 1) if the mesh determines them.
        """
        columns = [getattr(self, field.name) for field in fields(self)]
        for constants in zip(*columns):
            yield type(self)(*(each.item() if each.size == 1 else each for each in constants))

    def fraction(self, concentration: Values) -> Values:
        """Return m of max(C, 0).

        Parameters
        ----------
        concentration : float or array
            C, mg/L, of any shape.

        Returns
        -------
        float or array
            The fraction m, of the shape of C, without unit; 0 at C = 0.

        Raises
        ------
        NotImplementedError
            If the subclass does not define it.

        Examples
        --------
        >>> from repro.model.uptake_law import Monod
        >>> float(Monod(half_saturation=1.0).fraction(3.0))
        0.75
        """
        raise NotImplementedError

    def slope(self, concentration: Values) -> Values:
        """Return dm/dC at max(C, 0).

        Parameters
        ----------
        concentration : float or array
            C, mg/L, of any shape.

        Returns
        -------
        float or array
            The slope dm/dC, L/mg, of the shape of C. At C = 0 it is 1 / K, its largest value.

        Raises
        ------
        NotImplementedError
            If the subclass does not define it.

        Examples
        --------
        >>> from repro.model.uptake_law import Monod
        >>> float(Monod(half_saturation=2.0).slope(0.0))
        0.5
        """
        raise NotImplementedError

    def largest(self, supply: float) -> float:
        """Return an upper bound of m for concentrations up to a supply.

        Parameters
        ----------
        supply : float
            The largest C, mg/L.

        Returns
        -------
        float
            The bound, without unit; 1 if the subclass has no other one.

        Examples
        --------
        >>> from repro.model.uptake_law import Monod
        >>> Monod(half_saturation=1.0).largest(10.0)
        1.0
        """
        return 1.0

    def saturates(self, supply: float) -> bool:
        """Return whether uptake is nearly independent of C at a supply.

        Parameters
        ----------
        supply : float
            C, mg/L.

        Returns
        -------
        bool
            True if a small change of C hardly changes m. By default: if C exceeds K.

        Examples
        --------
        >>> from repro.model.uptake_law import Monod
        >>> Monod(half_saturation=1.0).saturates(10.0)
        True
        """
        return supply > self.half_saturation

    def extended(self, concentration: Values) -> tuple[Values, Values]:
        """Return m and dm/dC; below C = 0, m follows its tangent at zero."""
        slope = self.slope(concentration)
        return self.fraction(concentration) + np.minimum(concentration, 0.0) * slope, slope

    def proportional(self, concentration: Values) -> Values:
        """Return C / K, the tangent at zero of m and of the saturation."""
        return concentration / self.half_saturation

    def saturation(self, concentration: Values) -> Values:
        """Return s = C / (C + K) of max(C, 0)."""
        positive = np.maximum(concentration, 0.0)
        return positive / (positive + self.half_saturation)

    def saturation_slope(self, saturation: Values) -> Values:
        """Return ds/dC = (1 - s)^2 / K, L/mg."""
        return (1 - saturation) ** 2 / self.half_saturation

    def concentration(self, saturation: Values) -> Values:
        """Return C = K s / (1 - s), mg/L, for s up to LARGEST_SATURATION."""
        return self.half_saturation * saturation / (1 - saturation)

    def at_saturation(self, saturation: Values) -> tuple[Values, Values | float]:
        """Return m and dm/ds at a saturation."""
        bounded = np.minimum(saturation, LARGEST_SATURATION)
        concentration = self.concentration(bounded)
        slope = self.slope(concentration) / self.saturation_slope(bounded)
        return self.fraction(concentration), slope

    def sharpness(self, supply: Values) -> Values:
        """Return the part of the supply (mg/L) over which uptake decreases to zero.

        It is K / supply, at most 1.
        """
        return self.half_saturation / np.maximum(supply, self.half_saturation)

    def softened(self, factor: float, supply: Values) -> UptakeLaw:
        """Return the law with K multiplied by a factor, but not above the supply (mg/L)."""
        larger = np.minimum(factor * self.half_saturation, supply)
        return replace(self, half_saturation=np.maximum(self.half_saturation, larger))


class Monod(UptakeLaw):
    """Monod's law, m = C / (C + K): the fraction m equals the saturation s."""

    def fraction(self, concentration: Values) -> Values:
        """Return C / (C + K)."""
        return self.saturation(concentration)

    def slope(self, concentration: Values) -> Values:
        """Return K / (C + K)^2, L/mg."""
        return self.half_saturation / (np.maximum(concentration, 0.0) + self.half_saturation) ** 2

    def at_saturation(self, saturation: Values) -> tuple[Values, float]:
        """Return m = s and dm/ds = 1."""
        return saturation, 1.0


@dataclass(frozen=True, eq=False)
class Haldane(UptakeLaw):
    """Haldane's law, m = C / (K + C + C^2 / K_i): the donor inhibits its own uptake.

    inhibition: K_i, mg/L; infinite for the acceptor, so that its law is Monod's. The maximum of m,
    1 / (1 + 2 (K / K_i)^1/2), is at C = (K K_i)^1/2. Beyond, m decreases.
    """

    inhibition: Any
    monotone: ClassVar[bool] = False

    @classmethod
    def constants(cls, substrate: Substrate) -> tuple[float, ...]:
        """Return K and K_i (mg/L)."""
        return substrate.half_saturation, getattr(substrate, "inhibition_constant", np.inf)

    def _denominator(self, positive: Values) -> Values:
        return self.half_saturation + positive + positive**2 / self.inhibition

    def fraction(self, concentration: Values) -> Values:
        """Return C / (K + C + C^2 / K_i)."""
        positive = np.maximum(concentration, 0.0)
        return positive / self._denominator(positive)

    def slope(self, concentration: Values) -> Values:
        """Return (K - C^2 / K_i) / (K + C + C^2 / K_i)^2, L/mg; negative beyond the maximum."""
        positive = np.maximum(concentration, 0.0)
        rise = self.half_saturation - positive**2 / self.inhibition
        return rise / self._denominator(positive) ** 2

    def largest(self, supply: float) -> float:
        """Return the maximum of m, for any supply."""
        return 1 / (1 + 2 * np.sqrt(self.half_saturation / self.inhibition))


class FirstOrder(UptakeLaw):
    """Uptake of first order, m = C / K, without a bound: the limit of Monod's law for C << K."""

    def fraction(self, concentration: Values) -> Values:
        """Return C / K."""
        return np.maximum(concentration, 0.0) / self.half_saturation

    def slope(self, concentration: Values) -> Values:
        """Return 1 / K, L/mg."""
        return np.ones_like(concentration) / self.half_saturation

    def largest(self, supply: float) -> float:
        """Return supply / K."""
        return supply / self.half_saturation

    def saturates(self, supply: float) -> bool:
        """Return False."""
        return False


class ZeroOrder(UptakeLaw):
    """Uptake of zero order, the limit K -> 0 of m = 1 - exp(-C / K).

    On a mesh, K is the least value for which elements resolve the front (:meth:`RateLaw.on`). The
    uptake of a layer with C at its surface is then smaller than in the limit by the part K / (2 C).
    Without a mesh, K is LIMIT times the scene's K_s.
    """

    #: Ratio of K without a mesh to the scene's K_s.
    LIMIT: ClassVar[float] = 1e-5
    sharp: ClassVar[bool] = True

    @classmethod
    def constants(cls, substrate: Substrate) -> tuple[float, ...]:
        """Return K (mg/L) for use without a mesh."""
        return (cls.LIMIT * substrate.half_saturation,)

    def fraction(self, concentration: Values) -> Values:
        """Return 1 - exp(-C / K)."""
        return -np.expm1(-np.maximum(concentration, 0.0) / self.half_saturation)

    def slope(self, concentration: Values) -> Values:
        """Return exp(-C / K) / K, L/mg."""
        decayed = np.exp(-np.maximum(concentration, 0.0) / self.half_saturation)
        return decayed / self.half_saturation


#: {value of `kinetics.law`: law}.
LAWS: dict[str, type[UptakeLaw]] = {"dual Monod": Monod, "Haldane": Haldane,
                                    "first order": FirstOrder, "zero order": ZeroOrder}


def uptake_law(substrates: Substrates, kinetics: Kinetics) -> UptakeLaw:
    """Make the law of uptake of a scene's substrates."""
    return LAWS[kinetics.law].of(*substrates.modelled.values())
