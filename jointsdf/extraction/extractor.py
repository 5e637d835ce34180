"""Zero level set of a field as a part-labelled mesh, by marching cubes over the training box.

`dense` evaluates the field at every grid point, `sparse` near the surface only. The mesh is the same; `active_cells.py`
states how far that is guaranteed.
"""

import logging
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from jointsdf.errors import require_integer, require_one_of
from jointsdf.extraction.active_cells import activate_cells
from jointsdf.extraction.face_labels import Label, majority_labels, split_at_borders
from jointsdf.extraction.marching_cubes import march
from jointsdf.extraction.sparse_grid import Grid, Sdf
from jointsdf.values import LabelledMesh, Normalisation

log = logging.getLogger(__name__)


class Surface(NamedTuple):
    """A zero level set, without labels.

    Attributes:
        vertices: Positions, network frame.
        faces: Vertex indices, counter-clockwise seen from outside (where the sdf is positive).
        evaluated: Share of the grid points at which the field was evaluated, 0..1.
    """

    vertices: Float[ndarray, "v 3"]
    faces: Int[ndarray, "f 3"]
    evaluated: float


@dataclass(frozen=True)
class Extraction:
    """Marching cubes (Lewiner) of a field over the training box.

    Attributes:
        resolution: Grid points along each axis of the box.
        method: `sparse` evaluates the field near the surface only, `dense` everywhere.
        borders: `majority`: a face has the label of most of its vertices, or that of its centroid where all three
            differ (paper). `split`: faces are cut where the label changes; the surface does not move.
        chunk: Most points in one call of the field.

    Raises:
        InputError: A value out of its range.

    >>> ball = lambda points: np.linalg.norm(points, axis=1) - 0.5
    >>> surface = Extraction(resolution=33).surface(ball)
    >>> np.linalg.norm(surface.vertices, axis=1).max().round(2)
    np.float64(0.5)
    """

    resolution: int = 256
    method: str = "sparse"
    borders: str = "majority"
    chunk: int = 8192

    def __post_init__(self) -> None:
        """Check the ranges."""
        require_one_of("extraction.method", self.method, ("sparse", "dense"))
        require_one_of("extraction.borders", self.borders, ("majority", "split"))
        require_integer("extraction.resolution", self.resolution, 8, 1024)
        require_integer("extraction.chunk", self.chunk, 1)

    def surface(self, sdf: Sdf) -> Surface:
        """Zero level set of a field; empty where the field does not change sign.

        Args:
            sdf: float32 points of the network frame -> signed distance, negative inside.
        """
        grid = Grid(sdf, self.resolution, self.chunk)
        if self.method == "sparse":
            activate_cells(grid)
        else:
            grid.activate_all()
        vertices, faces = march(grid)
        evaluated = grid.evaluations / self.resolution**3
        log.info("extraction: %.1f%% of %d^3 grid points evaluated", 100 * evaluated, self.resolution)
        return Surface(vertices, faces, evaluated)

    def labelled_mesh(self, sdf: Sdf, label: Label, normalisation: Normalisation) -> LabelledMesh:
        """Zero level set with one part label per face, in file units.

        Args:
            sdf: float32 points of the network frame -> signed distance, negative inside.
            label: float32 points of the network frame -> original part id.
            normalisation: File frame -> network frame.
        """
        return self.label_faces(self.surface(sdf), label, normalisation)

    def label_faces(self, surface: Surface, label: Label, normalisation: Normalisation) -> LabelledMesh:
        """Give a surface from `surface` one part label per face, in file units; arguments as of `labelled_mesh`."""
        vertices, faces, _ = surface

        def label_chunks(points: Float[ndarray, "n 3"]) -> Int[ndarray, " n"]:
            starts = range(0, len(points), self.chunk)
            found = [label(points[start : start + self.chunk].astype(np.float32)) for start in starts]
            return np.concatenate([np.zeros(0, np.int64), *found]).astype(np.int64)

        if self.borders == "split":
            vertices, faces, labels = split_at_borders(vertices, faces, label_chunks(vertices), label_chunks)
        else:
            labels = majority_labels(vertices, faces, label_chunks(vertices), label_chunks)
        return LabelledMesh(normalisation.inverse(vertices), faces, labels)
