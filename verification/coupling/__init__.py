"""The coupled loop: the whole run against its averaged pore, special cases with a known answer, what is conserved, the
order in the time step, and what must not matter."""

from verification.problems import runs


def kinds(refinement: float, linear: float = 1.0) -> dict[str, tuple[str, ...]]:
    """Changes of a scene, by label: every kind of elements with the paper's scheme, refined so."""
    return {kind: (runs.of(kind), runs.coarser(kind, refinement, linear)) for kind in runs.ELEMENTS}


def every(refinement: float, linear: float = 1.0) -> dict[str, tuple[str, ...]]:
    """The same, and the presets."""
    return {**kinds(refinement, linear), **{preset: (runs.by(preset),) for preset in runs.PRESETS[1:]}}
