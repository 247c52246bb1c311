"""The aggregates of a scene by name or number: in dotted keys, in tables and in messages.

A scene has one table [aggregate], or a list of tables [[aggregate]]. A list with one table is that
table. In a list, ``aggregate.left.radius`` is a key of the body called left, and
``aggregate.2.radius`` one of the second body. Both work for a single table, too.
"""
from collections.abc import Sequence

from repro.scene.units import WORD, SceneError, as_list

SECTION = "aggregate"


def labels(names: Sequence[object]) -> list[str]:
    """The label of each body: its name, or its number from 1 if it has none of its own."""
    return [str(name if WORD.accepts(name) and name not in names[:k] else k + 1)
            for k, name in enumerate(names)]


def dotted_keys(names: Sequence[object]) -> list[str]:
    """The dotted key of each body's table."""
    return [SECTION] if len(names) == 1 else [f"{SECTION}.{label}" for label in labels(names)]


def numbered(keys: Sequence[str], section: str) -> str:
    """A section as the units of a scene count it: that of one of several bodies by its number."""
    several = len(keys) > 1 and section in keys
    return f"{SECTION}.{keys.index(section) + 1}" if several else section


def place_of(tables: object, label: str) -> int | None:
    """Place in the list of the body with a name or a number; None if there is none."""
    names = _names(tables)
    numbers = [str(k + 1) for k in range(len(names))]
    for known in (names, numbers):
        if label in known:
            return known.index(label)
    return None


def path_of(tables: dict, key: str) -> list:
    """Keys and places of lists that lead to a dotted key in the tables of a scene."""
    section, *below = key.split(".")
    bodies = tables.get(section, {})
    place = None
    if section == SECTION and below and isinstance(bodies, dict | list):
        place = place_of(bodies, below[0])
    if place is None:
        return [section, *below]
    return [section, *([] if isinstance(bodies, dict) else [place]), *below[1:]]


def canonical(tables: dict, key: str) -> str:
    """A dotted key with the body's own label, as messages write it."""
    section, *below = path_of(tables, key)
    if below and isinstance(below[0], int):
        below[0] = labels(_names(tables[section]))[below[0]]
    return ".".join([section, *below])


def refuse_unaddressed(tables: dict, key: str, stated: str, known: Sequence[str]) -> None:
    """Raise SceneError if a dotted key belongs to an aggregate that the scene does not have, or to
    one of several and does not say to which.

    stated: the entry in a message; known: all dotted keys.
    """
    section, *below = key.split(".")
    bodies = tables.get(section)
    if section != SECTION or not below or place_of(bodies, below[0]) is not None:
        return
    accepted = dotted_keys(_names(bodies))
    keys = [part for part in below[1:] or below if not part.isdigit()]
    example = ".".join([accepted[0], *keys])
    if isinstance(bodies, list):
        raise SceneError(f"{stated}: the scene has {len(bodies)} aggregates, "
                         f"{', '.join(accepted)}; one of them is needed, such as {example}")
    if isinstance(bodies, dict) and len(below) > 1 and f"{SECTION}.{below[0]}" not in known:
        raise SceneError(f"{stated}: the scene has one aggregate, without this name; {example} is "
                         "its key, and several aggregates are tables [[aggregate]]")


def single(tables: dict) -> dict:
    """The tables with a list of one aggregate as this aggregate."""
    listed = as_list(tables.get(SECTION)) if isinstance(tables, dict) else None
    if listed is None:
        return tables
    return {**tables, SECTION: listed[0] if len(listed) == 1 else listed}


def remaining(tables: dict) -> dict:
    """The tables without the aggregates that were left out, which are None."""
    listed = as_list(tables.get(SECTION))
    if listed is None or None not in listed:
        return tables
    kept = [body for body in listed if body is not None]
    without = {name: part for name, part in tables.items() if name != SECTION}
    return {**without, SECTION: kept} if kept else without


def _names(bodies: object) -> list[object]:
    listed = bodies if isinstance(bodies, list) else [bodies]
    return [body.get("name") if isinstance(body, dict) else None for body in listed]
