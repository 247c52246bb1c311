"""Figure 6 rests on a supply that the paper does not print: when wide makes contact with 5 to 40 K_s of both."""

from __future__ import annotations

from dataclasses import replace

from repro.march import simulation
from verification.claims.levels import converged
from verification.sensitivity.numbers import OF, Runs, scene

#: Supplies over K_s, and the size of the converged solution's elements and steps.
SUPPLIES, SIZE = (5.0, 10.0, 20.0, 40.0), 2**0.5
#: Hours by which all of them have made contact.
END = 120.0


def of_contact(said) -> dict[str, float]:
    """Time of contact (h), the state's ends (um) and the smallest acceptor in it (K_s)."""
    said = replace(said, output=replace(said.output, times=(END,)), growth=replace(said.growth, end=END))
    state = next(state for state, _ in simulation.steps(said) if state.pore.contact)
    outline, acceptor = state.pore.boundary, state.pore.concentrations.acceptor
    return {"contact_time": state.pore.time, "upstream": outline.upstream, "downstream": outline.downstream,
            "acceptor_min": float(acceptor.min()) / said.substrates.acceptor.half_saturation}


OF["contact"] = of_contact


def contacts(runs: Runs) -> dict[str, dict[str, float]]:
    """What `of_contact` tells, by the supply over K_s."""
    found = {}
    for supply in SUPPLIES:
        factors = {"supply of acceptor": supply / 10, "supply of donor": supply / 10}
        said = replace(scene("wide", factors, *converged(SIZE)), name="contact")
        found[f"{supply:g}"] = runs.numbers(said)
    return found
