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
from jointsdf.shapes.labels.providers import PROVIDERS, UnlabelledShape, provide
from jointsdf.shapes.loading import LabelRequest
from jointsdf.shapes.readers.file_mesh import FileMesh, check_mesh
from jointsdf.shapes.repair import repair_mesh
from jointsdf.shapes.units import AUTO, choose_unit
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
        labels: One integer >= -1 per face (-1: unlabelled), or a provider: `auto` and `geometric` segment the mesh,
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
    mesh = LabelledMesh(solid.vertices, solid.faces, np.full(len(solid.faces), UNLABELLED))
    if isinstance(labels, str):
        folder = None if partfield_dir is None else Path(partfield_dir).expanduser()
        request = LabelRequest(labels, num_parts, folder, needed=False)
        unlabelled = UnlabelledShape(
            called,
            FileMesh(points, triangles, digest),
            mesh,
            solid.source_faces,
            num_parts=request.num_parts,
            partfield_dir=request.partfield_dir,
            needed=request.needed,
        )
        found, provider = provide(request.labels, unlabelled)
    else:
        found, provider = _check_labels(labels, len(triangles))[solid.source_faces], "array"
    dropped = len(triangles) - len(solid.faces)
    return Shape(
        called,
        replace(mesh, labels=found),
        digest,
        provider,
        solid.watertight,
        flipped=solid.flipped,
        dropped=dropped,
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


def _check_labels(given: Any, count: int) -> Int[ndarray, " f"]:
    array = _to_array("labels", given)
    if array.shape != (count,) or array.dtype.kind not in "iu" or array.min() < UNLABELLED:
        raise InputError(
            f"labels of shape {array.shape} and type {array.dtype}: give one integer >= -1 for each of the {count} "
            f"faces, or one of {', '.join(PROVIDERS)}"
        )
    return array.astype(np.int64)


def _to_array(name: str, given: Any) -> ndarray:
    try:
        return np.asarray(given)
    except ValueError as error:
        raise InputError(f"{name}: rows of different lengths; give an array") from error
