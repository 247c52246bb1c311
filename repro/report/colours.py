"""The colours of values on pages: viridis, which the colour-blind can distinguish."""

import numpy as np

#: Red, green and blue of viridis at evenly spaced places. Linear colours between them are within
#: 6 of 255 of it.
VIRIDIS = np.array([tuple(bytes.fromhex(colour)) for colour in (
    "440154", "48186a", "472d7b", "424086", "3b528b", "33638d", "2c728e", "26818e", "21908c",
    "1f9f88", "28ae80", "3ebc74", "5dc963", "82d34c", "abdc32", "d5e21a", "fde725")])


def viridis(count: int, first: float = 0.0, last: float = 1.0) -> list[str]:
    """Colours such as "#440154", from dark to light, evenly spaced between two places (0 to 1)."""
    places = np.linspace(first, last, count) * (len(VIRIDIS) - 1)
    parts = [np.interp(places, np.arange(len(VIRIDIS)), part) for part in VIRIDIS.T]
    return ["#" + bytes(colour).hex() for colour in np.round(parts).astype(np.uint8).T]
