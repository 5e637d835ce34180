"""Sharp creases and corners for a marching-cubes mesh: its faces are cut where the planes of the two sides meet.

Source: Attene, Falcidieno, Rossignac and Spagnuolo, "Sharpen&Bend: Recovering Curved Sharp Edges in Triangle Meshes
Produced by Feature-Insensitive Sampling" (TVCG 2005), which splits the faces of a chamfer at the sides, extrapolated.
It differs in that the sides are planes by the field's gradients (`crease_band.py`), onto which vertices move too; that
the field tells creases from roundings (`crease_probes.py`); and that what gets worse goes back (`crease_settling.py`).

A face that is cut is replaced by faces with the same rim, and a cut is shared by both faces of its edge: a mesh that
was closed and manifold stays so, with the same components, Euler number and winding.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from jointsdf.extraction.crease_band import Band, Differential, crease_band
from jointsdf.extraction.crease_cuts import CutBand, cut_band
from jointsdf.extraction.crease_probes import find_crossings
from jointsdf.extraction.crease_settling import settle
from jointsdf.geometry.mesh import used_vertices

LONGEST_MOVE = 0.5  # of a vertex onto the plane of its side, cells


class SharpMesh(NamedTuple):
    """A mesh with creases.

    Attributes:
        vertices: Positions.
        faces: Vertex indices, counter-clockwise seen from outside.
        on_crease: Marks the vertices on creases and corners.
    """

    vertices: Float[ndarray, "v 3"]
    faces: Int[ndarray, "f 3"]
    on_crease: Bool[ndarray, " v"]


def sharpen(
    vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"], differential: Differential, cell: float
) -> SharpMesh:
    """Give a mesh of marching cubes the creases and corners of its field.

    Args:
        vertices: Network frame.
        faces: Counter-clockwise seen from outside.
        differential: Points of the network frame -> signed distances and gradients.
        cell: Edge of a cell of the grid, network length units.
    """
    unchanged = SharpMesh(vertices, faces, np.zeros(len(vertices), dtype=bool))
    if not len(faces):
        return unchanged
    band = crease_band(vertices, faces, differential, cell)
    band, crossings = find_crossings(band, differential, cell)
    if not len(crossings.ends):
        return unchanged
    cut = cut_band(band, crossings, vertices[band.vertices], _onto_sides(band, cell), cell)
    return _put_back(vertices, faces, band, cut, settle(band, cut, cell))


def _onto_sides(band: Band, cell: float) -> Float[ndarray, "b 3"]:
    """Move the vertices onto the planes of their sides."""
    offsets = np.einsum("ij,ij->i", band.anchors - band.points, band.normals)
    near = np.abs(offsets) < LONGEST_MOVE * cell
    return band.points + np.where(near, offsets, 0.0)[:, None] * band.normals


def _put_back(
    vertices: Float[ndarray, "v 3"],
    faces: Int[ndarray, "f 3"],
    band: Band,
    cut: CutBand,
    places: Float[ndarray, "w 3"],
) -> SharpMesh:
    """The whole mesh with the band's faces replaced, without vertices that no face uses."""
    own = len(band.vertices)
    number = np.concatenate([band.vertices, len(vertices) + np.arange(len(places) - own)])
    positions = np.concatenate([vertices, places[own:]])
    positions[number] = places
    on_crease = np.zeros(len(positions), dtype=bool)
    on_crease[number] = cut.on_crease
    kept = np.ones(len(faces), dtype=bool)
    kept[band.faces] = False
    used, whole = used_vertices(np.concatenate([faces[kept], number[cut.faces]]), len(positions))
    return SharpMesh(positions[used], whole, on_crease[used])
