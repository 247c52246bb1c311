"""The choices of a scheme, and their valid combinations."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass

#: {choice: accepted words}.
WORDS: dict[str, tuple[str, ...]] = {
    "elements": ("linear", "quadratic"),
    "steps": ("updates", "midpoint"),
    "carrier": ("w", "u"),
    "inlet": ("local", "mean"),
}
#: {elements: accepted transfers of biomass to a new mesh}.
TRANSFERS = {"linear": ("projection", "interpolation"), "quadratic": ("shares",)}
#: A concentration is not resolved if it is below zero by more than this part of its supply.
UNRESOLVED = 1e-3


@dataclass(frozen=True)
class Scheme:
    """How the equations of a scene are solved.

    The modules of the solver depend on the scheme and not on a preset. ``dataclasses.replace``
    changes a choice.

    Parameters
    ----------
    elements : {"linear", "quadratic"}
        Linear functions on straight triangles (3.2-3.4), or quadratic ones on curved triangles.
        They determine the spaces of velocity and pressure (:mod:`repro.model.flow`), the
        integration of uptake and growth (:mod:`repro.fem.space`), the stabilisation of growth
        (:mod:`repro.model.growth`) and the rule by which films close
        (:data:`repro.model.contact.CLOSINGS`). A scheme with the same elements must have the same
        ``transfer`` and the same last four choices.
    steps : {"updates", "midpoint"}
        Shape updates every ``growth.time_step`` (section 2), or the midpoint rule with error
        control (:mod:`repro.march`).
    carrier : {"w", "u"}
        Velocity that carries the substrates: w, whose divergence vanishes against every function
        of the space, or u as printed (:mod:`repro.model.transport`).
    inlet : {"local", "mean"}
        u_x(y) in the inlet's condition (11), or u_ave as printed [E4].
    transfer : {"projection", "interpolation", "shares"}
        Transfer of biomass to a new mesh (:mod:`repro.model.biomass`). On straight triangles:
        Galerkin's projection, which conserves biomass, or the paper's interpolation [E8]. On curved
        triangles: the fraction of X_I is transferred, and the density becomes X_m.
    modified_newton : bool
        Does Newton's method keep its derivative as long as it converges fast?
    follows_layers : bool
        Are elements refined at boundary layers and fronts?
    edges_at_tips : float
        W over the length of the edges at the tips of an outline, at refinement 1. The length is
        proportional to refinement^-2.
    undershoot : float
        Largest accepted concentration below zero in a step of Gear's method, over the supply.
    overshoot : float or None
        Largest accepted concentration above the supply, over the supply; None for no limit.

    Raises
    ------
    ValueError
        If a word is not accepted, or if the transfer does not fit the elements.

    Examples
    --------
    >>> from dataclasses import replace
    >>> from repro.schemes import PRINTED
    >>> projected = replace(PRINTED, transfer="projection")
    >>> projected.conserves_substrates, projected.conserves_biomass
    (False, True)
    """

    elements: str
    steps: str
    transfer: str
    modified_newton: bool
    carrier: str = "w"
    inlet: str = "local"
    _: KW_ONLY
    follows_layers: bool
    edges_at_tips: float
    undershoot: float
    overshoot: float | None

    def __post_init__(self) -> None:
        for choice, words in WORDS.items():
            _refuse_other(choice, getattr(self, choice), words)
        _refuse_other(f"transfer with {self.elements} elements", self.transfer,
                      TRANSFERS[self.elements])

    @property
    def order(self) -> int:
        """1: linear functions on straight triangles; 2: quadratic ones on curved triangles."""
        return WORDS["elements"].index(self.elements) + 1

    @property
    def controls_error(self) -> bool:
        """Does an error estimate choose the steps? The steps then have no length in advance."""
        return self.steps == "midpoint"

    @property
    def conserves_substrates(self) -> bool:
        """Are the balances of the substrates exact to round-off?"""
        printed_flux = self.carrier == "u" and self.order == 1
        return self.inlet == "local" and not printed_flux

    @property
    def conserves_biomass(self) -> bool:
        """Does the transfer to a new mesh conserve the biomass, to round-off?"""
        return self.transfer != "interpolation"


def _refuse_other(choice: str, word: object, words: tuple[str, ...]) -> None:
    """Raise ValueError if a word of a choice is not accepted."""
    if word not in words:
        accepted = " or ".join(f'"{each}"' for each in words)
        raise ValueError(f"scheme: {choice}: {accepted} is needed, not {word!r}")
