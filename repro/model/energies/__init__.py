"""Elastic energies of the aggregate, by the name of ``growth.energy``."""

from __future__ import annotations

from repro.model.energies.energy import Energy
from repro.model.energies.gent import Gent
from repro.model.energies.neo_hookean import NEO_HOOKEAN, NeoHookean
from repro.scene import Growth

__all__ = ["NEO_HOOKEAN", "Energy", "Gent", "NeoHookean", "energy_of"]

#: Each energy by its name in a scene.
ENERGIES: dict[str, type[Energy]] = {"neo-Hookean": NeoHookean, "Gent": Gent}


def energy_of(growth: Growth | None) -> Energy:
    """The energy of a scene's aggregate; the paper's without growth."""
    return NEO_HOOKEAN if growth is None else ENERGIES[growth.energy].of(growth)
