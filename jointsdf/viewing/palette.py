"""Palette: one fixed colour per part id in every picture and file, and colours of heads.

Those of parts are chosen by greedy max-min search of the distance in CIELAB under normal, protanopic and deuteranopic
vision; neighbouring ids differ in lightness and in hue.
"""

import numpy as np
from jaxtyping import Int, UInt8
from numpy import ndarray

PALETTE = (
    "4b8fd0 f3a74a 3f8f63 c9584f 8767a3 f3dd6e 07b4c3 de7ab7 795821 b5f791 5952b0 83c0a9 "
    "904a45 949aff 707b00 f9b5fe 1b6962 ca834f 983982 bcb578 a9748d 4ae5a9 dd8f87 ad2760"
)
COLOURS = np.array([list(bytes.fromhex(colour)) for colour in PALETTE.split()], dtype=np.float64)
UNLABELLED_COLOUR = (214, 214, 214)
# Okabe and Ito, distinct with any colour vision ("Color universal design", 2008).
HEAD_COLOURS = ("#7a7a7a", "#0072b2", "#e69f00", "#009e73", "#cc79a7", "#d55e00", "#56b4e9", "#b8a800")
# Each further round of the palette is mixed with black (negative) or white.
ROUNDS = np.array([0.0, -0.3, 0.4, -0.5, 0.6])


def part_colours(labels: Int[ndarray, " n"]) -> UInt8[ndarray, "n 3"]:
    """Colour (sRGB) of each part id; light grey for -1.

    Args:
        labels: Original part ids, -1 where unlabelled.

    >>> part_colours(np.array([0, -1])).tolist()
    [[75, 143, 208], [214, 214, 214]]
    """
    cycle, index = np.divmod(labels, len(COLOURS))
    mix = ROUNDS[cycle % len(ROUNDS)][:, None]
    colours = COLOURS[index] * (1 - np.abs(mix)) + 255 * np.maximum(mix, 0)
    colours[labels < 0] = UNLABELLED_COLOUR
    rounded: ndarray = np.rint(colours).astype(np.uint8)
    return rounded
