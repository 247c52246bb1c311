"""Scenes with another scheme: choices of a scheme beside the KEY=VALUE of a scene's changes."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

from repro.fem.space import Space
from repro.scene import Scene, Source, load_tables
from repro.scene import load_scene as load_plain
from repro.scene.keys import SCHEMES
from repro.schemes import CURVED, PAPER, Scheme

#: The scheme that has elements.
WITH_ELEMENTS = {"linear": PAPER, "quadratic": CURVED}
#: Choices that do not belong to the elements.
FREE = ("steps", "carrier", "inlet", "modified_newton")


@dataclass(frozen=True)
class Exchange:
    """Choices of a scheme, (name, word), that replace those of the preset."""

    choices: tuple[tuple[str, object], ...]

    def on(self, scheme: Scheme) -> Scheme:
        """The scheme with these choices. With other elements it has what belongs to them."""
        choices = dict(self.choices)
        if choices.get("elements", scheme.elements) != scheme.elements:
            choices = {**{name: getattr(scheme, name) for name in FREE}, **choices}
            scheme = WITH_ELEMENTS[choices["elements"]]
        return replace(scheme, **choices)


def scheme_on(space: Space) -> Scheme:
    """The scheme with the elements of a space."""
    return PAPER if space.order == 1 else CURVED


#: A change of a scene: KEY=VALUE, or choices of its scheme.
Change = str | Exchange


def exchange(**choices: object) -> Exchange:
    """Choices of a scheme, such as ``carrier="u"``."""
    return Exchange(tuple(sorted(choices.items())))


def load_scene(source: Source, changes: Iterable[Change] = (), unset: Iterable[str] = ()) -> Scene:
    """A scene with changes of its keys and of its scheme."""
    changes = tuple(changes)
    keys = [change for change in changes if isinstance(change, str)]
    exchanges = [change for change in changes if isinstance(change, Exchange)]
    unset = list(unset)
    if not exchanges:
        return load_plain(source, keys, unset=unset)
    return load_plain(source, keys, unset=unset, scheme=_exchanged(_scheme(source, keys, unset), exchanges))


def exchanged(scene: Scene, *exchanges: Exchange) -> Scene:
    """The scene with other choices of its scheme."""
    return load_plain(scene, scheme=_exchanged(scene.numerics.scheme, exchanges))


def _scheme(source: Source, keys: list[str], unset: list[str]) -> Scheme:
    """The scheme of a scene with changes of its keys. The rules of keys ask the exchanged scheme, not this one."""
    if isinstance(source, Scene) and source.numerics.exchanged:
        return source.numerics.exchanged
    return SCHEMES[load_tables(source, keys, unset).get("numerics", {}).get("preset", "fast")]


def _exchanged(scheme: Scheme, exchanges: Iterable[Exchange]) -> Scheme:
    for each in exchanges:
        scheme = each.on(scheme)
    return scheme
