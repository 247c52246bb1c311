"""The paper's claims that figures relate to, in a few words, and their verdicts as recorded by `make claims`."""

from __future__ import annotations

from functools import cache

from verification.claims import report

STATEMENTS = {
    "C01": "Base starts at a mean velocity of 2.9 m/d",
    "C02": "Base has slowed to 1.5 m/d by 19.4 h",
    "C03": "effluents of Base at 19.4 h: 4.19 K_s acceptor, 6.13 K_s donor",
    "C04": "about 60 % of the acceptor that enters is used up by then",
    "C05": "about 7 K_s at the inlet of the meshed part",
    "C06": "inert biomass stays under 0.5 % of the aggregate",
    "C07": "the first meshed part is 110 µm long",
    "C08": "the meshed part is 210 µm long at 19.4 h",
    "C09": "the biomass doubles in about 3 h",
    "C10": "growth is fastest upgradient, slowest on the wall downgradient of the centre",
    "C11": "the asymmetry is a few percent while the aggregate is fully penetrated",
    "C12": "once the pore is spanned, growth is upgradient only",
    "C16": "conductivity falls sharply when the aggregate spans the pore",
    "C17": "permeability can fall by the viscosity ratio, 2000, at most",
    "C19": "meshing a part of the pore around the aggregate is enough",
    "C20": "an exponential profile describes the part upstream that is not meshed",
    "C24": "the moving mesh loses quality slowly",
    "C25": "the aggregate may expand by up to 2000",
    "C29": "the aggregate is squeezed between the walls as it grows",
    "C30": "the acceptor is never used up",
    "C31": "the shape stays a half-disc until growth is limited or the aggregate squeezed",
    "C33": "Base is fully penetrated by its substrates",
    "C35": "fluid flows around the aggregate, and through it once it spans the pore",
    "C38": "it takes less biomass to plug a pore as an aggregate than as a biofilm",
    "C39": "a mass transfer coefficient cannot be set a priori, since it depends on the sink",
    "C40": "detachment by fracture where the stress is largest could be incorporated",
    "C41": "another rheology and other conditions at the walls hardly affect the conclusions",
    "C42": "a porous material instead of a raised viscosity may make a difference",
    "C43": "clogging restricts flow and supply, and then falls sharply, under constant head too",
    "C44": "a pore can be incorporated into a network model",
    "C45": "aggregate or layer, the distinction is not crucial for the consumption of substrates",
    "C46": "the stress could link fluid flow, growth and detachment",
    "C47": "a mass transfer coefficient is hard to set a priori, since the aggregate enhances its transport",
    "C48": "the surface is smooth, since the energy of the aggregate is minimal",
    "C49": "expansion by 2000 can be handled, also where the aggregate grows unevenly",
    "C50": "biomass bound to the wall distorts the geometry highly",
    "C51": "finite elements would not perform well there",
    "C52": "the adhesion required stems from fluid flow and from the conditions at the wall",
    "C54": "once the pore is spanned, most of the growth is upgradient",
    "C53": "body forces in a porous aggregate may make a difference, depending on the conditions",
}


@cache
def verdicts() -> dict[str, str]:
    """The verdict of each claim in the committed record."""
    return {claim["id"]: claim["verdict"] for claim in report.read()}


def judged(ids: tuple[str, ...]) -> str:
    """The verdicts of some claims, as a sentence of a caption."""
    return "Claims: " + "; ".join(f"{id} {verdicts().get(id, 'not judged')}" for id in ids) + "."
