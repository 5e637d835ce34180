"""Labels that somebody gave: the mesh file's own, a label file beside it or elsewhere, a column of a mesh file."""

import logging
from dataclasses import replace
from pathlib import Path

import numpy as np
from jaxtyping import Int
from numpy import ndarray

from jointsdf.errors import InputError
from jointsdf.shapes.labels.beside import find_label_file
from jointsdf.shapes.labels.columns import choose_column, find_column
from jointsdf.shapes.labels.face_matching import match_faces
from jointsdf.shapes.labels.face_order import find_other_mesh
from jointsdf.shapes.labels.files import read_labels
from jointsdf.shapes.labels.ids import check_ids, number_by_area
from jointsdf.shapes.labels.unlabelled import Labels, UnlabelledShape
from jointsdf.shapes.readers.file_mesh import OWN_LABELS, FileMesh
from jointsdf.shapes.readers.formats import format_of
from jointsdf.shapes.readers.triangles import read_triangles

logger = logging.getLogger(__name__)


def from_file(shape: UnlabelledShape, path: Path, column: str | None = None) -> Labels:
    """Read the labels in a file, as they are; names and colours are numbered by falling area.

    Args:
        shape: The mesh.
        path: A label file, or a mesh or STEP file: the shape's own, or another one of the same mesh.
        column: Of the faces of a mesh file; None for the one that holds its parts.

    Raises:
        InputError: The file is of another mesh or damaged, or the user gave a number of parts.
    """
    shape.refuse_count(f"labels file {path} gives its parts as they are")
    provider = f"file:{path.name}" + (f":{column}" if column else "")
    if format_of(path):
        return _from_column(shape, path, column), provider
    if column:
        raise InputError(f"labels={path}:{column}: only mesh and STEP files have columns; give labels={path}")
    if other := find_other_mesh(path, _corners(shape.file_mesh)):
        raise InputError(
            f"labels file {path} follows the faces of {other}, and {shape.name} has others or another order: "
            f"give labels={path.with_name(other)}, whose faces are found by their place"
        )
    labels = read_labels(path, shape.file_mesh, shape.patches)
    _warn_of_other_order(shape, path, labels)
    return labels[shape.source_faces], provider


def find_own(shape: UnlabelledShape) -> Labels | None:
    """Find the labels that the mesh file itself holds, else those in a label file beside it.

    Labels beside the file that are certainly of another order are passed over with a warning; so are those that
    differ from the file's own.

    Raises:
        InputError: Labels that cannot be used, or the user gave a number of parts.
    """
    if shape.path is None:
        return None
    own, beside = _find_own_column(shape), find_label_file(shape.path)
    other = find_other_mesh(beside, _corners(shape.file_mesh)) if beside else None
    if own is not None:
        shape.refuse_count(f"{shape.name} has its own labels")
        if beside and other is None and _differs(shape, own, beside):
            logger.warning(
                "%s: its own labels are taken, which differ from those in %s; labels=%s takes those",
                *(shape.name, beside, beside),
            )
        return own[shape.source_faces], f"file:{shape.path.name}"
    if other is not None:
        logger.warning("%s: %s beside it follows the faces of %s and is passed over", shape.name, beside, other)
        return None
    return from_file(shape, beside) if beside else None


def _warn_of_other_order(shape: UnlabelledShape, path: Path, labels: Int[ndarray, " g"]) -> None:
    """Warn where the mesh file holds the same labels, each as often, for other faces."""
    if OWN_LABELS not in shape.file_mesh.columns:
        return
    own = shape.file_mesh.columns[OWN_LABELS].values
    if not np.array_equal(own, labels) and np.array_equal(np.sort(own), np.sort(labels)):
        logger.warning(
            "%s: labels file %s holds the labels of the mesh file itself for other faces, which suggests another order "
            "of faces; labels=auto takes the file's own",
            *(shape.name, path),
        )


def _find_own_column(shape: UnlabelledShape) -> Int[ndarray, " g"] | None:
    """The file's own labels, if any of its faces is labelled."""
    if OWN_LABELS not in shape.file_mesh.columns:
        return None
    try:
        labels = check_ids(f"{shape.name}: its face property {OWN_LABELS}", shape.file_mesh.columns[OWN_LABELS].values)
    except InputError as error:
        raise InputError(f"{error}; labels=geometric leaves it out") from error
    return labels if labels.max() >= 0 else None


def _differs(shape: UnlabelledShape, own: Int[ndarray, " g"], beside: Path) -> bool:
    """True if the labels beside the file fit it, and differ from its own."""
    try:
        return not np.array_equal(from_file(shape, beside)[0], own[shape.source_faces])
    except InputError:
        return False


def _from_column(shape: UnlabelledShape, path: Path, column: str | None) -> Int[ndarray, " f"]:
    """Labels of the repaired mesh from a column of a mesh file."""
    is_own = shape.path is not None and path.samefile(shape.path)
    mesh = shape.file_mesh if is_own else read_triangles(path)[0]
    name = column or choose_column(f"labels file {path}", mesh)
    found = find_column(f"labels file {path}", mesh, name)
    values = check_ids(f"labels file {path}: its column {name}", found.values)
    if not is_own:
        values = values[match_faces(f"labels file {path}", _corners(mesh), _corners(shape.file_mesh))]
    labels = values[shape.source_faces]
    return labels if found.are_ids else number_by_area(replace(shape.solid, labels=labels))


def _corners(mesh: FileMesh) -> ndarray:
    return mesh.vertices[mesh.faces]
