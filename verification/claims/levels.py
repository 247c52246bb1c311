"""The levels at which claims are computed.

Claims about **the model** are judged with a converged solution, claims about **the scheme** with the scheme.

    converged   quadratic elements and the midpoint rule (the preset `accurate`, with small elements beside contact
                lines), refined in space and time at once:
                element sizes and the root of the time tolerance over those of the preset. The finest is judged, the
                bar comes from all three.
    scheme      the preset `paper`, at refinement 1 and a shape update every 12 min, and on other meshes and with other
                steps; beside a claim about the model on one to three meshes, whose range is `scheme_2001`.

Elements twice as large as those of the preset `paper` (7 across half a pore) are not asymptotic: with them the velocity
of base at 19.2 h shows an order of 2.9 to 3.1, without them 2.0. With steps of 2, 3 and 4 times 12 min a step ends at
19.2 h, and the next one ends with base, at 19.4 h.

To use another solver for the converged solution, change `CONVERGED` and `converged` alone.

A level is a context: a scene that a claim loads within `at_level` gets the elements and steps of that level, and
`cached` stores results per level.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass

from repro.scene.keys import PRESETS
from verification.store import Memory

CONVERGED, SCHEME = "converged", "scheme"
#: Preset of the converged solution at size 1.
PRESET = "accurate"
#: numerics.contact_elements of the converged solution at size 1. Without it entire edges of several um join the wall.
#: The conductivity of wide over the hours after contact is then 1.161 to 1.171 m/d from size 1.4 to 0.5, without an
#: order. With it the conductivity is 1.1695, 1.1726 and 1.1734 m/d from size 1.4 to 0.7.
CONTACT = 2.0


@dataclass(frozen=True)
class Level:
    """kind: CONVERGED or SCHEME; size of elements, and of steps between shape updates, over those of the preset; wide:
    KEY=VALUE by which the scene wide differs from that of Figure 6."""

    kind: str = SCHEME
    size: float = 1.0
    step: float = 1.0
    wide: tuple[str, ...] = ()


def converged(size: float) -> tuple[str, ...]:
    """Changes of a scene that make it the converged solution with elements and steps of a size: the length of a
    midpoint step goes as the root of its tolerance."""
    preset = PRESETS[PRESET]
    refinement = float(preset["refinement"]) / size
    tolerance = float(preset["tolerance"]) * size**2
    return (f'numerics.preset="{PRESET}"', f"numerics.refinement={refinement!r}", f"numerics.tolerance={tolerance!r}",
            f"numerics.contact_elements={CONTACT / size!r}")


#: Sizes of the converged solution, the judged one first; sizes for claims that read wide; and sizes for claims that
#: compare several runs of their own. The last are around the preset "fast", which is 2.25: an error that both runs of a
#: pair share cancels in their difference.
FINE = (0.5, 2**-0.5, 1.0)
WIDE_FINE = (2**-0.5, 1.0, 2**0.5)
PAIRED = tuple(2.25 * 2 ** (third / 3) for third in (-1, 0, 1))
#: Sizes for variants of wide. A run with half the least angle of contact depends on its mesh: at 1.79 it stops in a
#: step after contact, in which a triangle is turned over.
COMPARED = tuple(1.25 * 2 ** (half / 2) for half in (1, 2, 3))
#: Sizes for claims that compare many runs, around the preset "fast" and larger. Bonded base ends early on finer ones.
MANY = tuple(2.25 * 2 ** (third / 3) for third in range(3))
#: Sizes for runs of wide with the fluid's forces, whose slide and tractions depend on the mesh: larger elements halve
#: them.
FORCES = (2**0.5, 2.0, 2 * 2**0.5)
#: Size of the scheme beside claims that compare runs of their own, which are expensive.
BESIDE_PAIRS = (2**0.5,)
#: Sizes and steps of the scheme, the default first.
SIZES = (1.0, 2**0.5, 2**-0.5, 0.5)
STEPS = (1.0, 2.0, 3.0, 4.0)
#: Sizes whose range is the scheme's interval beside a claim about the model, and beside one about wide, whose runs are
#: expensive.
BESIDE = SIZES[:3]
ABOUT_WIDE = {"fine": WIDE_FINE, "beside": SIZES[:2]}
#: A single size or step.
ALONE = (1.0,)
DEFAULT = Level()

_current: ContextVar[Level] = ContextVar("level", default=DEFAULT)


def current() -> Level:
    """The level at which numbers are computed now."""
    return _current.get()


@contextmanager
def at_level(level: Level) -> Iterator[None]:
    """Compute at a level."""
    token = _current.set(level)
    try:
        yield
    finally:
        _current.reset(token)


_memory = Memory(current)
#: Store the results of a function by arguments and level; drop the results of a level.
cached, forget = _memory.cached, _memory.forget
