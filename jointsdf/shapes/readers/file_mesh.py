"""Triangles of one mesh file with what the file says of them: polygons, columns of the faces, unit."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float, Int, Shaped
from numpy import ndarray

from jointsdf.errors import InputError
from jointsdf.values import Unit

LARGEST = 1e30  # coordinate: areas and volumes of larger ones overflow
OWN_LABELS = "label"  # column of the part ids that the file itself gives; `labels=auto` takes it


@dataclass(frozen=True)
class FaceColumn:
    """Numbers of the faces of a mesh file under one name, e.g. a PLY property, or its groups, materials or colours.

    Attributes:
        values: One number per triangle.
        are_ids: True: numbers that the file holds, kept as they are. False: numbers of names or colours in the order of
            their first face, which mean nothing by themselves.
    """

    values: Shaped[ndarray, " f"]
    are_ids: bool


@dataclass(frozen=True)
class FileMesh:
    """Triangles of one mesh file, in the file's frame and order.

    Attributes:
        vertices: Positions, all finite.
        faces: Vertex indices, all in range.
        sha256: Of the file's bytes, and those of files that belong to it; "" from the reader of a format, unless it
            read such a file, since it does not know what the bytes came from.
        polygons: The file's own face that each triangle is of, ascending from 0 without gaps, where faces were cut into
            triangles; else None.
        columns: Columns of the triangles by name.
        unit: Length unit that the file declares; None where it declares none.
        up: Axis that points up: `z` in CAD, `y` in glTF.
    """

    vertices: Float[ndarray, "v 3"]
    faces: Int[ndarray, "f 3"]
    sha256: str = ""
    polygons: Int[ndarray, " f"] | None = None
    columns: Mapping[str, FaceColumn] = field(default_factory=dict)
    unit: Unit | None = None
    up: str = "z"

    @property
    def has_polygons(self) -> bool:
        """True if faces of the file were cut into triangles."""
        return self.polygons is not None


def number_names(names: Shaped[ndarray, " f"]) -> Int[ndarray, " f"]:
    """Number the distinct values of an array in the order of their first appearance.

    >>> number_names(np.array(["rib", "base", "rib"]))
    array([0, 1, 0])
    """
    _, first, index = np.unique(names, return_index=True, return_inverse=True)
    numbers: Int[ndarray, " f"] = np.argsort(np.argsort(first))[index.reshape(-1)]
    return numbers


def check_mesh(source: str, vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"]) -> None:
    """Refuse a mesh without faces, with a coordinate that is not finite or absurd, or with a vertex index out of range.

    Args:
        source: Names the mesh in messages.
        vertices: Positions.
        faces: Vertex indices.

    Raises:
        InputError: It is one of these.
    """
    if len(faces) == 0:
        raise InputError(f"{source} has no faces: a triangle mesh is needed, not points or curves")
    if not np.isfinite(vertices).all():
        bad = int((~np.isfinite(vertices).all(axis=1)).sum())
        raise InputError(f"{source} has NaN or infinite coordinates in {bad} vertices: repair or export it again")
    if (largest := np.abs(vertices).max(initial=0)) > LARGEST:
        raise InputError(f"{source} has a coordinate of {largest:.3g}, beyond {LARGEST:g}: repair or export it again")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise InputError(f"{source} has a face that uses a vertex out of range 0..{len(vertices) - 1}: export it again")
