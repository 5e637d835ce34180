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

from jointsdf.errors import require_integer, require_number, require_one_of
from jointsdf.extraction.active_cells import activate_cells
from jointsdf.extraction.crease_band import Differential
from jointsdf.extraction.face_labels import Label, majority_labels, split_at_borders
from jointsdf.extraction.marching_cubes import march
from jointsdf.extraction.sharpening import SharpMesh, sharpen
from jointsdf.extraction.simplification import simplify
from jointsdf.extraction.small_pieces import drop_small_pieces
from jointsdf.extraction.sparse_grid import MOST_EVALUATED, Grid, Sdf
from jointsdf.values import BOX, LabelledMesh, Normalisation

COARSEST = 0.01  # bound of the simplification, of the longest side

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
        sharp: Whether creases and corners are made sharp, by the field's gradients.
        smallest_piece: Pieces smaller than this share of the surface's longest side are left out.
        simplify: Distance by which the labelled surface may move when faces of nearly flat regions are merged, of its
            longest side; 0 merges none.

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
    sharp: bool = False
    smallest_piece: int | float = 0
    simplify: int | float = 0

    def __post_init__(self) -> None:
        """Check the ranges."""
        require_one_of("extraction.method", self.method, ("sparse", "dense"))
        require_one_of("extraction.borders", self.borders, ("majority", "split"))
        require_integer("extraction.resolution", self.resolution, 8, 1024)
        require_integer("extraction.chunk", self.chunk, 1)
        require_one_of("extraction.sharp", self.sharp, (True, False))
        require_number("extraction.smallest_piece", self.smallest_piece, 0, 1)
        require_number("extraction.simplify", self.simplify, 0, COARSEST)

    def surface(self, sdf: Sdf) -> Surface:
        """Zero level set of a field; empty where the field does not change sign.

        Args:
            sdf: float32 points of the network frame -> signed distance, negative inside.

        Raises:
            TooLarge: It fills the box: more than `MOST_EVALUATED` points near it, where only those are evaluated, or
                more than `MOST_FACES` faces.
        """
        grid = Grid(sdf, self.resolution, self.chunk, MOST_EVALUATED if self.method == "sparse" else None)
        if self.method == "sparse":
            activate_cells(grid)
        else:
            grid.activate_all()
        vertices, faces = march(grid)
        evaluated = grid.evaluations / self.resolution**3
        log.info("extraction: %.1f%% of %d^3 grid points evaluated", 100 * evaluated, self.resolution)
        return Surface(vertices, faces, evaluated)

    def labelled_mesh(
        self, sdf: Sdf, label: Label, normalisation: Normalisation, differential: Differential | None = None
    ) -> LabelledMesh:
        """Zero level set with one part label per face, in file units.

        Args:
            sdf: float32 points of the network frame -> signed distance, negative inside.
            label: float32 points of the network frame -> original part id.
            normalisation: File frame -> network frame.
            differential: float32 points of the network frame -> signed distance and its gradient; needed for `sharp`.
        """
        return self.label_faces(self.surface(sdf), label, normalisation, differential)

    def label_faces(
        self, surface: Surface, label: Label, normalisation: Normalisation, differential: Differential | None = None
    ) -> LabelledMesh:
        """Give a surface from `surface` its creases and one part label per face; arguments as of `labelled_mesh`."""
        vertices, faces, on_crease = self._with_creases(surface, differential)

        def label_chunks(points: Float[ndarray, "n 3"]) -> Int[ndarray, " n"]:
            starts = range(0, len(points), self.chunk)
            found = [label(points[start : start + self.chunk].astype(np.float32)) for start in starts]
            return np.concatenate([np.zeros(0, np.int64), *found]).astype(np.int64)

        if self.borders == "split":
            at_vertices = label_chunks(vertices)
            vertices, faces, labels = split_at_borders(vertices, faces, at_vertices, label_chunks, on_crease)
        else:
            labels = majority_labels(vertices, faces, label_chunks(vertices), label_chunks)
        return simplify(LabelledMesh(normalisation.inverse(vertices), faces, labels), self.simplify)

    def _with_creases(self, surface: Surface, differential: Differential | None) -> SharpMesh:
        """The surface, sharp where it is asked for."""
        vertices, faces = drop_small_pieces(surface.vertices, surface.faces, self.smallest_piece)
        if not self.sharp:
            return SharpMesh(vertices, faces, np.zeros(len(vertices), dtype=bool))
        assert differential is not None, "creases are found by gradients"

        def in_chunks(points: Float[ndarray, "n 3"]) -> tuple[Float[ndarray, " n"], Float[ndarray, "n 3"]]:
            starts = range(0, len(points), self.chunk)
            found = [differential(points[start : start + self.chunk].astype(np.float32)) for start in starts]
            sdf, gradients = (np.concatenate(column).astype(np.float64) for column in zip(*found, strict=True))
            return sdf, gradients

        return sharpen(vertices, faces, in_chunks, 2 * BOX / (self.resolution - 1))
