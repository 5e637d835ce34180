"""Warning of coordinates that a file rounds: 32-bit floats far from the origin."""

import logging

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from jointsdf.shapes.readers.file_mesh import LARGEST

COARSE = 1e-5  # spacing of coordinates that is warned of, of the longest side

logger = logging.getLogger(__name__)


def warn_of_rounding(source: str, vertices: Float[ndarray, "v 3"]) -> None:
    """Warn where coordinates that were stored as 32-bit floats lie so far from the origin that their steps show.

    Args:
        source: Names the mesh in messages.
        vertices: Positions. Those that no 32-bit float holds, as after a change of place, are not warned of;
            nor are those that are refused for their size.
    """
    vertices = vertices[np.isfinite(vertices).all(axis=1)]
    largest = np.abs(vertices).max(initial=0)
    if len(vertices) == 0 or largest > LARGEST or not np.array_equal(vertices.astype(np.float32), vertices):
        return
    spacing = float(np.spacing(np.float32(largest)))
    size = float(np.ptp(vertices, axis=0).max())
    if size > 0 and spacing > COARSE * size:
        logger.warning(
            "%s: far from the origin, its 32-bit coordinates are rounded to %.2g (%.2g %% of the size): export it near "
            "the origin, or in 64 bits (PLY double, OBJ, STEP)",
            source,
            spacing,
            100 * spacing / size,
        )
