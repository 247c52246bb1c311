"""The meanings of the claims' words, with their origins. Each was written before its verdict was computed.

The numbers of most claims were known by then, since the claims had been judged by one bound each. A meaning is
therefore taken from the paper's other sentences, from the use of the word in the field, or from a dictionary, and not
from a number. The first meaning of a claim is that of its own bounds. Numbers that the paper prints, closed forms,
places and signs have no words of degree: these claims are judged as stated.

"A few percent" is taken for up to 3, 5 and 10 %: the paper calls the 1.6 % of its mass balance "a few percentage
points", and errors "of the order of a few percent" have one digit. Five was the first definition.

Some meanings were taken back after their values were known (`TAKEN_BACK`); the rows of their claims say so.

"May", "could" and "can" have one rule (C40, C42, C44, C46, C53): one scene with a measured effect is enough, and the
absence of an effect in another scene contradicts nothing.

C16 and C43 (until 2026-11-30) compared a slope over the last 10 % of biomass, between hourly rows, with that of a
fall to a tenth within a quarter more biomass. They now compare this fall itself, from 50 rows up to contact. The new
numbers were known from a reader's computation when the definition was written: a fall of 7.5 times in base, a slope
of 11.5 in wide, and of 7.3 at most while a film is left.
"""

from math import inf

from verification.claims import MEANINGS, TAKEN_BACK, Meaning

FIRST = "the first definition"
FEW_OF = "a few: three, as in dictionaries (more than two)"
ORDER_OF = "of the order of a few: one digit"


def under(**bounds: float) -> dict[str, tuple[float, float]]:
    """Upper bounds by the beginnings of quantities; an underscore is a blank."""
    return {name.replace("_", " "): (-inf, bound) for name, bound in bounds.items()}


def few(*names: str, judges: tuple[str, ...] = ("",)) -> tuple[Meaning, Meaning, Meaning]:
    """Meanings of "a few percent" as an upper bound of quantities, in percent."""
    return (Meaning("up to 5 %", FIRST, judges),
            Meaning("up to 3 %", FEW_OF, judges, {name: (-inf, 3) for name in names}),
            Meaning("up to 10 %", ORDER_OF, judges, {name: (-inf, 10) for name in names}))


def more(*names: str, judges: tuple[str, ...] = ("",)) -> tuple[Meaning, Meaning, Meaning]:
    """Meanings of "more than a few percent" as a lower bound of quantities, in percent."""
    return (Meaning("more than 5 %", FIRST, judges),
            Meaning("more than 3 %", FEW_OF, judges, {name: (3, inf) for name in names}),
            Meaning("more than 10 %", ORDER_OF, judges, {name: (10, inf) for name in names}))


#: The quantities of C15 in one shape.
ONE_SHAPE = ("acceptor consumed at", "donor consumed at", "share of")
#: The choices of C41.
VARIED = ("born stress-free", "middles rechosen", "film halved", "film doubled", "angle halved", "angle doubled")

MEANINGS |= {
    "C02": (
        Meaning("in the state that the paper plots, as printed", FIRST, ("mean velocity in the shape of 19.2",)),
        Meaning("after the expansion, with the inputs within their rounding", "\"after 19.4 hours\"; Table 1 rounds",
                ("largest velocity after",))),
    "C03": (
        Meaning("as printed, in the state of Plate 1", FIRST, ("effluent",)),
        Meaning("raised by the paper's own 1.6 %, in the shape and with the biomass of 19.2 h",
                "section 4: the effluents must be 1.6 % higher to balance; other times are whole updates",
                ("19.2 h, effluent",))),
    "C09": (
        Meaning("the largest rate, of Table 1", "\"Because the doubling time is ~3 hours and the decay rate is 0.12\": "
                "both are constants of the kinetics", ("doubling time at saturation", "decay half-time")),),
    "C11": (
        Meaning("both halves within 5 %", FIRST, ("extent", "growth", "expansion")),
        Meaning("the error of perfect symmetry, half of the difference, within 3 %",
                "section 4: \"errors created by assuming perfect symmetry ... a few percent\"",
                ("extent", "growth", "expansion"),
                {name: (-inf, 6) for name in ("extent", "growth", "expansion")}),
        Meaning("from point to point within a tenth", "minor: small against the whole", ("point by point",))),
    "C12": (
        Meaning("95 % of the new area and of the new biomass", FIRST),
        Meaning("99 % of both", "only: what a line of Figure 6 could show", ("",),
                {"new area": (99, inf), "biomass made": (99, inf)})),
    "C13": (
        *few("correction needed", judges=("correction needed", "least error")),
        Meaning("at every time", "section 4: \"throughout the whole numerical simulation\"", ("hour until",))),
    "C14": (
        Meaning("the defect halves with the mesh size at least", FIRST),
        Meaning("the defect falls", "\"leads to a better mass balance\"", ("",), {"fall of the": (1, inf)})),
    "C15": (
        Meaning("within 5 %", FIRST, ONE_SHAPE),
        Meaning("within 10 %", "about the same: as \"~60 %\" is about 58.1", ONE_SHAPE,
                {"acceptor consumed": (0.9, 1.1), "donor consumed": (0.9, 1.1)}),
        Meaning("nearer to zero than to first order", "the paper's reason: \"Monod kinetics simplifies to zero order "
                "reaction\"; first order doubles the uptake", ONE_SHAPE,
                {"acceptor consumed": (-inf, 1.5), "donor consumed": (-inf, 1.5)}),
        Meaning("in runs with both supplies, within 10 %", "\"if influent concentration were higher\": from the start",
                ("acceptor consumed in", "donor consumed in"),
                {"acceptor consumed in": (0.9, 1.1), "donor consumed in": (0.9, 1.1)})),
    "C16": (
        Meaning("to a hundredth at contact, and twice as steeply as with a uniform layer", FIRST,
                ("K / K_clean", "wide: -d ln K / d ln A over")),
        Meaning("to a tenth within a quarter more biomass", "sharply: an order of magnitude while the aggregate hardly "
                "grows", ("fall of wide",)),
        Meaning("at the moment of contact, to a tenth", "section 4: \"When the aggregate ... attaches to the opposite "
                "wall, flow is forced through the aggregate\"", ("fall as the last film closes",))),
    "C18": (
        Meaning("two to ten seconds, one to ten minutes and hours", FIRST),
        Meaning("seconds and not minutes", "the sentence orders the scales: seconds, minutes, hours", ("",),
                {"advection": (1, 60)})),
    "C19": (
        Meaning("within 0.5 %", FIRST),
        Meaning("within 0.1 %", "section 3.3.2: the paper's accuracy of transport", ("",), under(largest_error=0.1))),
    "C20": (
        Meaning("the mean within 0.1 %, sections within 5 %", FIRST),
        Meaning("sections within 1 %", "perpendicular: (26) is to describe each point", ("",),
                under(**{"acceptor:_largest": 1, "donor:_largest": 1}))),
    "C21": (
        Meaning("in base a disturbance grows in steps of 12 min", FIRST, ("error with", "growth of", "equal steps")),
        Meaning("in base or wide", "\"a priori not stable\": one case is enough",
                ("error with", "the largest growth", "equal steps")),
        Meaning("a step of 12 min is less accurate than 0.1 %", "the sentence gives the accuracy of its control",
                ("error with", "error of one step", "equal steps"))),
    "C22": (
        Meaning("with the orders of theory", FIRST, ("order of", "stability number")),
        Meaning("errors fall with the mesh", "convergent: as defined, at any order", ("order of", "stability number"),
                {"order of": (0.5, inf), "stability number, finest": (0.5, inf)}),
        Meaning("errors fall with the mesh, and without the term they do not, on meshes without a pattern either",
                "\"as a pure Galerkin method is not convergent\": no kind of mesh is named", ("",),
                {"order of": (0.5, inf), "stability number, finest": (0.5, inf)})),
    "C24": (
        Meaning("a twentieth in an update, five updates between remeshes", FIRST),
        Meaning("a tenth in an update, ten updates between remeshes", "gradually: over hours, not updates", ("",),
                {"base: largest fall": (-inf, 0.1), "base: fewest": (10, inf)})),
    "C25": (
        Meaning("2000 after one to three days", FIRST),
        Meaning("2000 after one and a half to two and a half days", "a couple: two", ("",),
                {"wide: time": (36, 60)})),
    "C26": (
        Meaning("stresses and strains to a tenth", FIRST, ("base", "wide, a film left", "wide, a plug")),
        Meaning("no effect on conductivity and shape beyond 5 %", "introduction: neglected, since \"the emphasis is on "
                "the effects of growth\"", ("forces included",)),
        Meaning("no effect beyond 1 %", "the paper's accuracy of its mass balance, 1 %", ("forces included",),
                under(forces_included=1))),
    "C29": (
        Meaning("at the end three times as long as high", FIRST),
        Meaning("longer than a half-disc by a tenth", "squeezed: pressed out of its shape", ("",),
                {"the same at the end": (2.2, inf)})),
    "C30": (
        Meaning("C_A of K_s at least", FIRST, ("base: smallest", "wide: smallest")),
        Meaning("never zero", "always present: dictionary", ("the smaller",)),
        Meaning("so much that the missing decay is at most 5 %", "the same sentence: \"thus the model as formulated "
                "describes decay sufficiently well\"", ("base: biomass", "wide: biomass")),
        Meaning("so much that the missing decay is at most 1 %", "the paper's accuracy of its mass balance, 1 %",
                ("base: biomass", "wide: biomass"), {"base: biomass": (-inf, 1), "wide: biomass": (-inf, 1)})),
    "C31": few("base", "wide before"),
    "C32": (
        Meaning("all stresses to a tenth of the modulus", FIRST),
        Meaning("new biomass without stress changes shape and conductivity by 5 % at most",
                "section 5: \"unlikely to substantially affect the overall conclusions ... because of\" them",
                ("base, 19.2 h, born", "wide, mean")),
        Meaning("the same by 1 % at most", "the paper's accuracy of its mass balance, 1 %",
                ("base, 19.2 h, born", "wide, mean"),
                {"base, 19.2 h, born": (-1, 1), "wide, mean": (-1, 1)}),
        Meaning("stresses in the plane to a tenth of mu_L", "Table 1: mu_L is the only modulus that the paper gives",
                ("base: in-plane shear stress / mu_L", "wide: in-plane shear stress / mu_L"))),
    "C35": (
        Meaning("5 % through the aggregate, then 95 %", FIRST),
        Meaning("less than half, then more than half", "around and through: most of the flux", ("",),
                {"base": (-inf, 50), "wide": (50, inf)})),
    "C36": (
        Meaning("0.1 % at the meshed end, 5 % at the end of 600 um", FIRST),
        Meaning("with the length the effect falls below any bound, as exp(-u x / D)",
                "\"This assumption is valid for a sufficiently long channel\"", ("uptake, (12)", "its decay"))),
    "C38": (
        Meaning("less; porosity differs by 5 %", FIRST),
        Meaning("less; porosity differs twofold", "crucial: of a size that decides", ("",),
                {"the part filled": (2, inf)})),
    "C39": (
        Meaning("by 5 %, with the drop from the pore's supply", FIRST, ("acceptor, supply", "donor, supply")),
        Meaning("by 5 %, with the drop from the bulk 25 um upstream", "a film of tens of um, as in biofilm models",
                ("acceptor, 25 um", "donor, 25 um")),
        Meaning("by 5 %, with the drop from the bulk at its edge", "section 4: the concentration falls towards "
                "the aggregate", ("acceptor, its edge", "donor, its edge")),
        Meaning("at all", "depends on: dictionary; more than the bar", ("",),
                {"acceptor": (0, inf), "donor": (0, inf)})),
    "C42": (
        Meaning("one difference of more than 0.1 %", "section 3.3.2: the paper's accuracy", ("conductivity",)),
        Meaning("one difference beyond its bar", "may: one scene with a measured effect is enough", ("conductivity",),
                {"conductivity": (0, inf)})),
    "C41": (
        Meaning("outlines moved onto each other, conductivity of the mean, by 5 %", "defined on 2026-11-22 14:59",
                tuple(f"{name}: {kind}" for name in VARIED for kind in (
                    "outlines moved", "time", "conductivity, mean"))),
        Meaning("outlines where they lie, conductivity of the mean, by 5 %", FIRST,
                tuple(f"{name}: {kind}" for name in VARIED for kind in (
                    "outlines where", "time", "conductivity, mean"))),
        Meaning("all of these, and the conductivity of the first hour, by 10 %", "substantially: a tenth", ("",),
                {f"{name}: {kind}": (-inf, 10) for name in VARIED for kind in ("outlines", "time", "conductivity")})),
    "C43": (
        Meaning("to a tenth", FIRST, ("velocity", "acceptor", "growth", "decay")),
        Meaning("to a half", "restricts: limits", ("velocity", "acceptor", "growth", "decay"),
                {name: (-inf, 0.5) for name in ("velocity", "acceptor", "growth")})),
    "C46": (
        Meaning("by 5 % in one state", FIRST),
        Meaning("in one state beyond its bar", "could: one scene with a measured effect is enough", ("",),
                {"largest principal stress": (0, inf)})),
    "C47": (
        Meaning("by 5 %", FIRST),
        Meaning("the coefficient by a quarter", "the scatter of textbook correlations", ("",),
                {f"{name}: largest over smallest": (25, inf) for name in ("acceptor", "donor")})),
    "C48": (
        Meaning("no crease has less energy", FIRST),
        Meaning("no small wave lowers the energy",
                "a minimum may be a local one: Biot's stretch of a half-space, 0.544", ("",),
                {name: (0.544, inf) for name in ("base", "wide", "slow pore")})),
    "C49": (
        Meaning("2000 in some pore, after a couple of days", "can: one scene is enough", ("wide",)),
        Meaning("smooth for three days in both pores, and 2000 in one", FIRST, ("wide: largest", "slow pore: time"))),
    "C50": (
        Meaning("by 20 %", FIRST),
        Meaning("by a half", "highly: a strain near one", ("",),
                {"outlines": (50, inf), "mean distortion": (50, inf), "length of contact": (-inf, 50)}),
        Meaning("ten times as distorted as if it slides", "the sentence compares both walls",
                ("distortion over", "length of contact"))),
    "C51": (
        Meaning("some run of bonded base ends before base", "would not perform well: does not reach the end",
                ("first end",)),
        Meaning("no mesh helps", "the paper needs another method", ("last end",))),
    "C52": more("required by", judges=("required by fluid flow, the most", "required by bonding")),
    "C53": (
        Meaning("one difference of more than 0.1 %", "section 3.3.2: the paper's accuracy", ("the most",)),
        Meaning("one difference beyond its bar", "may: one scene with a measured effect is enough", ("the most",),
                {"the most": (0, inf)})),
    "C54": (
        Meaning("more than half; twice as much as downgradient", "most: dictionary, the greater part", ("",)),
        Meaning("three quarters", "most: clearly more than half", ("",),
                {"base, 76 h: biomass": (75, inf), "wide: biomass": (75, inf)})),
    "C60": few("extent of the upstream half, error of symmetry (", "area of the upstream half, error of symmetry (",
               "growth rate of the upstream half, error of symmetry ("),
    "C61": (
        Meaning("within 0.1 %", FIRST),
        Meaning("within 0.01 %", "an initial condition that does not matter at all", ("",),
                under(acceptor_after=0.01, donor_after=0.01, biomass_made=0.01))),
    "C63": (
        Meaning("to a hundredth of the way", FIRST, ("base", "wide")),
        Meaning("to a tenth of the way; bent at all", "regain: as an observer sees it", ("",),
                {"base": (-inf, 0.1), "wide": (-inf, 0.1), "the most": (0, inf)}),
        Meaning("bent visibly", "the sentence reports what was observed: \"bending with the flow\"", ("the most",))),
    "C64": few("base", "wide", judges=("base: fall", "wide: fall")),
}

#: Meanings that were taken back after their values were known.
TAKEN_BACK |= {
    "C09": "at the supply (3.63 h), and of the aggregate of base (3.72 h, the first definition). Both fail, and the "
           "claim was a matter of degree; but the sentence names constants of the kinetics, and so the largest rate",
    "C03": "within the few percent of the paper's own balance. All four numbers are within 1.7 %, so it holds, and the "
           "claim would be a matter of degree; but the effluents are printed digits and not words",
    "C36": "1 % at the end of 600 um. The effect there is 2.6 %, so it fails, and the claim would be a matter of "
           "degree; but the sentence is about a sufficiently long channel, and at 900 um the effect is 1 %",
    "C46": "by 10 % in one state. It fails, and the claim would be a matter of degree; but one measured effect is "
           "enough for \"could\"",
    "C53": "by 5 %. It fails, and the claim would be a matter of degree; but one measured effect is enough for \"may\"",
}
