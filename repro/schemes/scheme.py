"""What a scheme chooses, and which choices go together."""

from __future__ import annotations

from dataclasses import dataclass

#: The accepted words of each choice.
WORDS: dict[str, tuple[str, ...]] = {
    "elements": ("linear", "quadratic"),
    "steps": ("updates", "midpoint"),
    "carrier": ("w", "u"),
    "inlet": ("local", "mean"),
    "transfer": ("projection", "interpolation", "shares"),
}
#: Transfers of biomass to a new mesh, by the elements.
TRANSFERS = {"linear": ("projection", "interpolation"), "quadratic": ("shares",)}


@dataclass(frozen=True)
class Scheme:
    """How the equations of a scene are solved.

    The modules of the solver ask the scheme; none of them knows a preset. ``replace`` of
    ``dataclasses`` exchanges a choice.

    Parameters
    ----------
    elements : {"linear", "quadratic"}
        Functions on straight triangles (3.2-3.4), or on curved ones. They determine the pair of
        velocity and pressure (:mod:`repro.model.flow`), the integration of uptake and growth
        (:mod:`repro.fem.space`), the stabilisation of growth (:mod:`repro.model.growth`) and the
        closing of contact surfaces (:data:`repro.model.contact.CLOSINGS`).
    steps : {"updates", "midpoint"}
        Shape updates every ``growth.time_step`` (section 2), or the midpoint rule with error
        control (:mod:`repro.march`).
    carrier : {"w", "u"}
        Velocity that carries the substrates: w, whose divergence vanishes against every function
        of the space, or u as printed (:mod:`repro.model.transport`).
    inlet : {"local", "mean"}
        u_x(y) in the inlet's condition (11), or u_ave as printed [E4].
    transfer : {"projection", "interpolation", "shares"}
        Biomass on a new mesh (:mod:`repro.model.biomass`): on straight triangles Galerkin's
        projection, which conserves it, or the paper's interpolation [E8]; on curved ones the shares
        of X_I at the density X_m.
    modified_newton : bool
        Does Newton's method keep its derivative while the iterates converge fast?

    Raises
    ------
    ValueError
        If a word is not accepted, or if the elements have no such transfer.

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
    def follows_layers(self) -> bool:
        """Are elements refined at boundary layers and fronts? Linear ones, the paper's, are not."""
        return self.order > 1

    @property
    def controls_error(self) -> bool:
        """Does an error estimate choose the steps? The steps then have no length in advance."""
        return self.steps == "midpoint"

    @property
    def conserves_substrates(self) -> bool:
        """Do the balances of the substrates close to round-off?"""
        printed_flux = self.carrier == "u" and self.order == 1
        return self.inlet == "local" and not printed_flux

    @property
    def conserves_biomass(self) -> bool:
        """Does a new mesh have the biomass of the old one, to round-off?"""
        return self.transfer != "interpolation"


def _refuse_other(choice: str, word: object, words: tuple[str, ...]) -> None:
    """Raise ValueError unless a word of a choice is accepted."""
    if word not in words:
        accepted = " or ".join(f'"{each}"' for each in words)
        raise ValueError(f"scheme: {choice}: {accepted} is needed, not {word!r}")
