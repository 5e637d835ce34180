"""Places of the vertices along creases at which no face folds over or passes through another.

Every vertex has two places: on the surface of marching cubes, and where it belongs. Where faces are spoiled there,
their vertices first move among their neighbours, then part of the way back: at worst the surface stays as it was.
"""

import logging

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.sparse import csr_array

from jointsdf.extraction.crease_band import Band, edges_of
from jointsdf.extraction.crease_cuts import CutBand
from jointsdf.geometry.mesh import face_normals
from jointsdf.geometry.piercings import find_piercings

log = logging.getLogger(__name__)

RELAXED = 4  # rounds in which a vertex moves among its neighbours
HALVINGS = 2  # of its way, before it stays where marching cubes put it
SMALLEST = 1e-7  # area of a face, of the median
BLOCK = 2.0  # side of the blocks of space in which faces are looked at again, cells


def settle(band: Band, cut: CutBand, cell: float) -> Float[ndarray, "w 3"]:
    """Places of the vertices of a cut band.

    Ends: a vertex moves back `RELAXED + HALVINGS + 1` times at most, and faces without a moved vertex count as sound.

    Args:
        band: With the planes of the sides.
        cut: Its faces, cut along creases.
        cell: Edge of a cell of the grid.
    """
    count = len(cut.after)
    share, tries, after = np.ones(count), np.zeros(count, dtype=np.int64), cut.after
    means, blocks = _neighbour_means(cut), _Blocks(cut, BLOCK * cell)
    a, b, c = cut.after[cut.faces.T]
    smallest = SMALLEST * float(np.median(np.linalg.norm(np.cross(b - a, c - a), axis=1)))
    looked_at = np.arange(len(cut.faces))
    while True:
        places = cut.before + share[:, None] * (after - cut.before)
        spoiled = _spoiled_vertices(band, cut, places, share > 0, looked_at, smallest)
        if not spoiled.any():
            log.info("extraction: %d vertices on creases, %d short of them", cut.on_crease.sum(), (share < 1).sum())
            return places
        tries[spoiled] += 1
        after = np.where((spoiled & (tries <= RELAXED))[:, None], _relax(band, cut, after, means @ after), after)
        share[spoiled & (tries > RELAXED)] /= 2
        share[tries > RELAXED + HALVINGS] = 0
        looked_at = blocks.faces_near(spoiled)


def _spoiled_vertices(
    band: Band,
    cut: CutBand,
    places: Float[ndarray, "w 3"],
    moved: Bool[ndarray, " w"],
    rows: Int[ndarray, " r"],
    smallest: float,
) -> Bool[ndarray, " w"]:
    """Mark moved vertices of faces, of `rows`, that turn away from their side, have no area or pass through others."""
    faces = cut.faces[rows]
    changed = moved[faces].any(axis=1)
    a, b, c = places[faces.T]
    flat = np.linalg.norm(np.cross(b - a, c - a), axis=1) <= smallest
    away = np.einsum("fd,fd->f", face_normals(places, faces), band.normals[cut.owners[rows]]) < 0
    spoiled = np.zeros(len(places), dtype=bool)
    spoiled[faces[changed & (away | flat)]] = True
    sound = faces[~flat]
    if len(sound):
        found = find_piercings(places, sound)
        pairs = np.stack([found.face, found.pierced], axis=1)
        spoiled[sound[pairs[changed[~flat][pairs].any(axis=1)]]] = True
    return spoiled & moved


def _neighbour_means(cut: CutBand) -> csr_array:
    """Matrix that takes the mean of the neighbours of every vertex, those on creases alone for one on a crease."""
    edges, count = edges_of(cut.faces, len(cut.after)), len(cut.after)
    pairs = np.concatenate([edges, edges[:, ::-1]])
    one, other = pairs[~cut.on_crease[pairs[:, 0]] | cut.on_crease[pairs[:, 1]]].T
    weights = 1 / np.maximum(np.bincount(one, minlength=count), 1)
    return csr_array((weights[one], (one, other)), shape=(count, count))


def _relax(
    band: Band, cut: CutBand, after: Float[ndarray, "w 3"], means: Float[ndarray, "w 3"]
) -> Float[ndarray, "w 3"]:
    """Every vertex at the mean of its neighbours, as far as its plane or its crease lets it go."""
    moves = np.einsum("wd,wd->w", means - after, cut.along)[:, None] * cut.along
    free = np.flatnonzero(~cut.on_crease)  # vertices of the band, which come first
    moves[free] = (means - after)[free]
    moves[free] -= np.einsum("wd,wd->w", moves[free], band.normals[free])[:, None] * band.normals[free]
    return after + moves


class _Blocks:
    """Faces by the blocks of space that their vertices are in.

    Args:
        cut: The faces.
        size: Side of a block, longer than a face.
    """

    def __init__(self, cut: CutBand, size: float) -> None:
        blocks = np.floor(cut.before / size).astype(np.int64)
        blocks -= blocks.min(axis=0) - 1
        self._shape = blocks.max(axis=0) + 2
        self._strides = np.array([self._shape[1] * self._shape[2], self._shape[2], 1])
        self._of_vertex = blocks @ self._strides
        self._of_face = self._of_vertex[cut.faces]

    def faces_near(self, chosen: Bool[ndarray, " w"]) -> Int[ndarray, " r"]:
        """Faces with a vertex in a block of a chosen vertex, or in one beside it."""
        steps = (np.indices((3, 3, 3)).reshape(3, -1).T - 1) @ self._strides
        taken = np.zeros(int(self._shape.prod()), dtype=bool)
        taken[np.unique(self._of_vertex[chosen])[:, None] + steps] = True
        return np.flatnonzero(taken[self._of_face].any(axis=1))
