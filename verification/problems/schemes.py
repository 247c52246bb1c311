"""Scenes with another scheme: choices of a scheme beside the KEY=VALUE of a scene's changes."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

from repro.scene import Scene, Source
from repro.scene import load_scene as load_plain
from repro.schemes import CURVED, PAPER, Scheme

#: The scheme that has elements.
WITH_ELEMENTS = {"linear": PAPER, "quadratic": CURVED}


@dataclass(frozen=True)
class Exchange:
    """Choices of a scheme, (name, word), that replace those of the preset."""

    choices: tuple[tuple[str, object], ...]

    def on(self, scheme: Scheme) -> Scheme:
        """The scheme with these choices. With other elements it has their transfer."""
        choices = dict(self.choices)
        if "elements" in choices:
            choices = {"transfer": WITH_ELEMENTS[choices["elements"]].transfer, **choices}
        return replace(scheme, **choices)


#: A change of a scene: KEY=VALUE, or choices of its scheme.
Change = str | Exchange


def exchange(**choices: object) -> Exchange:
    """Choices of a scheme, such as ``carrier="u"``."""
    return Exchange(tuple(sorted(choices.items())))


def load_scene(source: Source, changes: Iterable[Change] = (), unset: Iterable[str] = ()) -> Scene:
    """A scene with changes of its keys and of its scheme."""
    changes = tuple(changes)
    keys = [change for change in changes if isinstance(change, str)]
    scene = load_plain(source, keys, unset=list(unset))
    exchanges = [change for change in changes if isinstance(change, Exchange)]
    return exchanged(scene, *exchanges)


def exchanged(scene: Scene, *exchanges: Exchange) -> Scene:
    """The scene with other choices of its scheme."""
    scheme = scene.numerics.scheme
    for each in exchanges:
        scheme = each.on(scheme)
    return load_plain(scene, scheme=scheme) if exchanges else scene
