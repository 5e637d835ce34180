"""Specks: small pieces of a reconstruction that nothing in the ground truth is near."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from jointsdf.errors import require_number
from jointsdf.geometry.topology import component_sizes, pieces
from jointsdf.metrics import closest_point
from jointsdf.values import SurfaceSamples


@dataclass(frozen=True)
class Specks:
    """Number of artefacts, `specks`: pieces smaller than `size` and farther from the truth than their own size.

    A piece is a set of faces connected through shared vertices; its size is the longest side of its bounding box. The
    crumbs of a thin tip or wall that the grid broke lie where the truth has a surface and are no specks.

    Args:
        size: In the frame of the samples, where the longest side is 1.

    Raises:
        InputError: A size below 0.
    """

    size: float = 0.003
    ceilings: ClassVar[tuple[str, ...]] = ("specks",)

    def __post_init__(self) -> None:
        """Check the size."""
        require_number("evaluation specks.size", self.size, 0)

    def __call__(self, predicted: SurfaceSamples, truth: SurfaceSamples) -> dict[str, float]:
        """Count the specks of the prediction; NaN where the truth has no faces."""
        if truth.mesh.is_empty:
            return {"specks": math.nan}
        mesh = predicted.mesh
        piece = pieces(mesh)
        sizes = component_sizes(mesh.vertices.astype(np.float64), mesh.faces, piece)
        small = np.flatnonzero(sizes < self.size * truth.frame.scale)
        corners = (mesh.vertices[np.unique(mesh.faces[piece == number])].astype(np.float64) for number in small)
        distances = [closest_point(truth.mesh).query(points)[0].min() for points in corners]
        return {"specks": float((distances > sizes[small]).sum())}
