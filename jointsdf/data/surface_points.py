"""Points on a surface with normals and part ids, before a training cloud is made of them."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from jointsdf.errors import InputError

MOST_ROUNDS = 1000  # of drawing points until there are enough


@dataclass(frozen=True)
class SurfacePoints:
    """Points on a surface, file frame.

    Attributes:
        points: Positions.
        normals: Unit normals, 0 where unknown.
        labels: Original part ids, -1 where unlabelled.
    """

    points: Float[ndarray, "n 3"]
    normals: Float[ndarray, "n 3"]
    labels: Int[ndarray, " n"]

    def __len__(self) -> int:
        return len(self.points)

    def take(self, chosen: Int[ndarray, " m"] | Bool[ndarray, " n"]) -> "SurfacePoints":
        """The chosen points."""
        return SurfacePoints(self.points[chosen], self.normals[chosen], self.labels[chosen])


def bounding_box(points: Float[ndarray, "n 3"]) -> Float[ndarray, "2 3"]:
    """Lowest and highest corner."""
    return np.stack([points.min(axis=0), points.max(axis=0)]).astype(np.float64)


def draw_enough(draw: Callable[[int], SurfacePoints], count: int) -> SurfacePoints:
    """Draw round by round until there are `count` points.

    Raises:
        InputError: A thousand rounds give fewer.
    """
    pieces: list[SurfacePoints] = []
    for number in range(MOST_ROUNDS):
        pieces.append(draw(number))
        if sum(map(len, pieces)) >= count:
            arrays = zip(*((each.points, each.normals, each.labels) for each in pieces), strict=True)
            return SurfacePoints(*(np.concatenate(each)[:count] for each in arrays))
    raise InputError("data.corruption.scanner: its views see next to nothing of the mesh; leave it out")
