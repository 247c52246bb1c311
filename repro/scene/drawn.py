"""The outline of an aggregate from a file: a polygon in GeoJSON or CSV, or the mask of an image.

The coordinates of a polygon are those of the pore, x from its middle and y from the lower wall. The
lower edge of a mask is the lower wall, its middle column is x = 0, and pixels other than zero are
the aggregate. What stands on its wall becomes a line from the upstream to the downstream end.
"""
import csv
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from repro.scene.needed import package
from repro.scene.rules import FINEST, SIDES
from repro.scene.units import MOST_POINTS, Drawn, Refused

if TYPE_CHECKING:
    from shapely import Polygon

#: Largest file of a polygon (bytes), and mask (pixels): a microscope's camera has fewer.
LARGEST, MOST_PIXELS = 10_000_000, 100_000_000


@dataclass(frozen=True)
class Shape:
    """A polygon, um; resolution: um, of its coordinates: points this near to a wall are on it."""

    polygon: "Polygon"
    resolution: float
    stepped: bool = False


def points_of(drawn: Drawn, wall: str, width: float) -> tuple[tuple[float, float], ...]:
    """Read the points (x, y), um, of an aggregate on a wall from the file of its outline.

    Raises Refused, with the reason, if the file has no outline in a pore of this width (um).
    """
    read = READERS.get(Path(drawn.file).suffix.lower())
    if read is None:
        raise Refused(f"a file that ends in {', '.join(READERS)} is needed")
    try:
        shape = read(drawn, width)
    except Refused:
        raise
    except OSError as error:
        raise Refused(f"{drawn.file} cannot be read ({error.strerror or error})") from None
    except (ValueError, TypeError, KeyError, IndexError, RecursionError):
        raise Refused(f"{drawn.file}: a polygon is needed, closed: its first point is also its "
                      "last one") from None
    line = _on_wall(shape, wall, width)
    if len(line) > MOST_POINTS:
        raise Refused(f"at most {MOST_POINTS} points are accepted, not {len(line)}")
    return line


def _polygon(rings: list, drawn: Drawn, width: float) -> Shape:
    """The polygon of a list of rings. Raises Refused if it is not one closed ring."""
    from shapely import Polygon

    if len(rings) != 1:
        raise Refused(f"a polygon without holes is needed, not {len(rings)} rings")
    ring = [(float(x) * drawn.um_per_unit, float(y) * drawn.um_per_unit) for x, y in rings[0]]
    if ring[0] != ring[-1]:
        raise Refused("a closed ring is needed: its first point is also its last one")
    return Shape(Polygon(ring), FINEST * width)


def _geojson(drawn: Drawn, width: float) -> Shape:
    part = json.loads(_text(drawn.file))
    while "coordinates" not in part:
        part = _only(part["features"]) if "features" in part else part["geometry"]
    polygons = {"Polygon": [part["coordinates"]], "MultiPolygon": part["coordinates"]}
    rings = _only(polygons[part["type"]])
    return _polygon([[point[:2] for point in ring] for ring in rings], drawn, width)


def _only(polygons: list) -> Any:
    """The only entry of a list. Raises Refused if there are others."""
    if len(polygons) != 1:
        raise Refused(f"one polygon is needed, not {len(polygons)}")
    return polygons[0]


def _csv(drawn: Drawn, width: float) -> Shape:
    rows = [row[:2] for row in csv.reader(_text(drawn.file).splitlines()) if row]
    head = rows[0][0].strip()[:1] not in "+-.0123456789"
    return _polygon([rows[head:]], drawn, width)


def _text(file: str) -> str:
    with open(file, "rb") as opened:
        content = opened.read(LARGEST + 1)
    if len(content) > LARGEST:
        raise Refused(f"{file}: more than {LARGEST} bytes")
    return content.decode("utf-8-sig")


def _mask(drawn: Drawn, width: float) -> Shape:
    """The polygon around the pixels of a mask that are not zero."""
    import numpy as np
    from shapely import box, unary_union

    try:
        images = package("PIL.Image", "pillow")
    except ImportError as error:
        raise Refused(str(error)) from None
    with images.open(drawn.file, formats=["PNG"]) as image:
        if image.width * image.height > MOST_PIXELS:
            raise Refused(f"{drawn.file}: more than {MOST_PIXELS} pixels")
        inside = np.asarray(image.convert("L")) > 0
    pixel = drawn.um_per_unit
    if len(inside) * pixel > width + pixel:
        raise Refused(f"the mask is {len(inside) * pixel:g} um high and the pore {width:g} um: "
                      "crop it at the walls, or correct um_per_unit")
    edge = np.diff(np.pad(inside.astype(np.int8), ((0, 0), (1, 1))), axis=1)
    row, start = np.nonzero(edge == 1)
    end = np.nonzero(edge == -1)[1]
    low = (len(inside) - 1 - row) * pixel
    left, right = ((column - inside.shape[1] / 2) * pixel for column in (start, end))
    shape = unary_union(box(left, low, right, low + pixel))
    if not inside.any():
        raise Refused("the mask is empty: pixels of the aggregate are other than zero")
    if inside[:, [0, -1]].all():
        raise Refused("water at an end of the mask is needed: its pixels are zero, those of the "
                      "aggregate other than zero")
    region = _only(getattr(shape, "geoms", [shape]))
    if region.interiors:
        raise Refused("a mask without holes is needed")
    return Shape(region, pixel, stepped=True)


#: How a file is read, by the end of its name.
READERS: dict[str, Callable[[Drawn, float], Shape]] = {
    ".geojson": _geojson, ".json": _geojson, ".csv": _csv, ".png": _mask}


def _on_wall(shape: Shape, wall: str, width: float) -> tuple[tuple[float, float], ...]:
    """The line around a polygon from the upstream to the downstream end on its wall.

    A line of pixels is smoothed: it is at most a pixel away from theirs, and contact stays.
    """
    from shapely import LineString
    from shapely.geometry.polygon import orient

    if not shape.polygon.is_valid or not shape.polygon.area > 0:
        raise Refused("a polygon that does not cross itself is needed")
    near = shape.resolution
    _, low, _, high = shape.polygon.bounds
    if high - low <= near:
        raise Refused(f"a larger um_per_unit is needed: the polygon is {high - low:g} um high")
    if low < -near or high > width + near:
        raise Refused(f"a polygon in the pore, y from 0 to {width:g} um, is needed; with this "
                      f"um_per_unit it is from {low:g} to {high:g} um")
    own_level, opposite = (0.0, width) if wall == "lower" else (width, 0.0)
    ring = [(x, next((level for level in (0.0, width) if abs(y - level) <= near), y))
            for x, y in orient(shape.polygon).exterior.coords[:-1]]
    on_wall = [y == own_level for _, y in ring]
    leaves = [k for k in range(len(ring)) if on_wall[k] and not on_wall[(k + 1) % len(ring)]]
    if len(leaves) != 1 or sum(on_wall) < 2:
        other = "upper" if wall == "lower" else "lower"
        elsewhere = any(y == opposite for _, y in ring) and not any(on_wall)
        hint = f', and the other one, for which wall = "{other}" is needed' if elsewhere else ""
        raise Refused(f"one side of the polygon on its wall ({SIDES[wall][0]}) is needed; it "
                      f"touches the wall in {len(leaves)} places{hint}")
    ring = ring[leaves[0]:] + ring[:leaves[0]]
    end = next(k for k, (_, y) in enumerate(ring) if k and y == own_level)
    line = ring[:end + 1]
    line = line if wall == "upper" else line[::-1]
    if not shape.stepped:
        return tuple(line)
    touching = [k for k, (_, y) in enumerate(line) if y == opposite]
    cuts = [0, *touching[:1], *touching[-1:], len(line) - 1]
    pieces = [LineString(line[start:end + 1]).simplify(near).coords
              for start, end in zip(cuts, cuts[1:]) if end > start]
    return (*line[:1], *(point for piece in pieces for point in piece[1:]))
