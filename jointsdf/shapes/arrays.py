"""Shapes from arrays in memory, with the repairs and label providers of files."""

import hashlib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from jointsdf.errors import InputError
from jointsdf.shapes.labels.array_files import flatten_column
from jointsdf.shapes.labels.ids import check_ids
from jointsdf.shapes.labels.lengths import spread_labels
from jointsdf.shapes.labels.providers import provide
from jointsdf.shapes.labels.unlabelled import UnlabelledShape
from jointsdf.shapes.loading import LabelRequest
from jointsdf.shapes.readers.file_mesh import FileMesh, check_mesh
from jointsdf.shapes.repair import repair_mesh
from jointsdf.shapes.units import AUTO, choose_unit
from jointsdf.user_paths import expand_home
from jointsdf.values import ASSUMED_UNIT, UNLABELLED, LabelledMesh, Shape


def from_arrays(
    vertices: Any,
    faces: Any,
    *,
    labels: str | Sequence[int] | Int[ndarray, " f"] = "auto",
    num_parts: int | None = None,
    partfield_dir: str | Path | None = None,
    name: str | None = None,
    unit: str = AUTO,
) -> Shape:
    """Make a shape of a triangle mesh, in the frame of its vertices.

    Args:
        vertices: Positions, shape (v, 3).
        faces: Vertex indices of triangles, shape (f, 3), counter-clockwise seen from outside.
        labels: One integer per face or vertex (-1: unlabelled), or a provider: `auto` and `geometric` segment the mesh,
            `none` leaves it without parts; or the path of a label file in the order of the faces.
        num_parts: Number of parts, for a provider that can choose.
        partfield_dir: PartField's output folder, for `labels="partfield"`.
        name: Names the shape; `mesh-<6 hex digits of its content>` without.
        unit: Of the vertices: mm, cm, m, um, in or ft; `auto`: mm is assumed.

    Raises:
        InputError: Arrays of another shape, values out of range, or labels that do not fit.
    """
    points, triangles = _check_vertices(vertices), _check_faces(faces)
    digest = hashlib.sha256(points.tobytes() + triangles.tobytes()).hexdigest()
    called = name or f"mesh-{digest[:6]}"
    check_mesh(called, points, triangles)
    solid = repair_mesh(called, points, triangles)
    file_mesh = FileMesh(points, triangles, digest)
    mesh = LabelledMesh(solid.vertices, solid.faces, np.full(len(solid.faces), UNLABELLED))
    if isinstance(labels, str):
        folder = None if partfield_dir is None else Path(expand_home(str(partfield_dir)))
        request = LabelRequest(labels, num_parts, folder, needed=False)
        unlabelled = UnlabelledShape(
            called,
            file_mesh,
            mesh,
            solid.source_faces,
            num_parts=request.num_parts,
            partfield_dir=request.partfield_dir,
            needed=request.needed,
        )
        found, provider = provide(request.labels, unlabelled)
    else:
        array = flatten_column("the array of labels", _to_array("labels", labels))
        ids = spread_labels("the array of labels", check_ids("the array of labels", array), file_mesh)
        found, provider = ids[solid.source_faces], "array"
    dropped = len(triangles) - len(solid.faces)
    return Shape(
        called,
        replace(mesh, labels=found),
        digest,
        provider,
        solid.watertight,
        flipped=solid.flipped,
        dropped=dropped,
        folded=solid.folded,
        welded=solid.welded,
        unit=choose_unit(called, ASSUMED_UNIT, unit),
    )


def _check_vertices(given: Any) -> Float[ndarray, "v 3"]:
    array = _to_array("vertices", given)
    if array.ndim != 2 or array.shape[1] != 3 or array.dtype.kind not in "fiu":
        raise InputError(f"vertices of shape {array.shape} and type {array.dtype}: give numbers in shape (v, 3)")
    return np.ascontiguousarray(array, dtype=np.float64)


def _check_faces(given: Any) -> Int[ndarray, "f 3"]:
    array = _to_array("faces", given)
    if array.ndim != 2 or array.shape[1] != 3 or array.dtype.kind not in "iu":
        raise InputError(f"faces of shape {array.shape} and type {array.dtype}: give integers in shape (f, 3)")
    return np.ascontiguousarray(array, dtype=np.int64)


def _to_array(name: str, given: Any) -> ndarray:
    try:
        return np.asarray(given)
    except ValueError as error:
        raise InputError(f"{name}: rows of different lengths; give an array") from error
