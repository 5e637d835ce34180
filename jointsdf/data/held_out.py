"""Points of a cloud that are held out of its fit, to score it without a mesh: one in ten, all over the surface."""

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

RUN = 10  # of so many neighbours along the curve one is held out
SEED = 1_000_003  # fixed: all runs of a cloud are scored by the same points
BITS = 21  # of each coordinate in a Morton code of 63 bits
SPREAD = (  # shifts and masks that put two zeros between the bits of a number (Morton 1966)
    (32, 0x1F00000000FFFF),
    (16, 0x1F0000FF0000FF),
    (8, 0x100F00F00F00F00F),
    (4, 0x10C30C30C30C30C3),
    (2, 0x1249249249249249),
)


def mark_held_out(points: Float[ndarray, "n 3"]) -> Bool[ndarray, " n"]:
    """Mark a tenth of the points: one at random of every ten on end along a space-filling curve (stratified sampling).

    Args:
        points: The cloud, any frame.
    """
    order = np.argsort(morton_codes(points), kind="stable")
    starts = np.arange(0, len(points) - RUN + 1, RUN)
    held = np.zeros(len(points), dtype=bool)
    held[order[starts + np.random.default_rng(SEED).integers(RUN, size=len(starts))]] = True
    return held


def morton_codes(points: Float[ndarray, "n 3"]) -> Int[ndarray, " n"]:
    """Place of each point along the Z-order curve through the cube about all of them.

    >>> morton_codes(np.array([[0.0, 0, 0], [1, 1, 1], [1, 0, 0]])).argsort().tolist()
    [0, 2, 1]
    """
    low, side = points.min(axis=0), np.ptp(points, axis=0).max()
    cells = ((points - low) / side * ((1 << BITS) - 1)).astype(np.uint64)
    for shift, mask in SPREAD:
        cells = (cells | cells << np.uint64(shift)) & np.uint64(mask)
    return np.asarray((cells[:, 0] | cells[:, 1] << np.uint64(1) | cells[:, 2] << np.uint64(2)).astype(np.int64))
