"""Part labels in files of their own, by ending: arrays, text, JSON, points, ABC features."""

from collections.abc import Callable
from pathlib import Path

from jaxtyping import Int, Shaped
from numpy import ndarray

from jointsdf.errors import InputError
from jointsdf.shapes.labels.array_files import flatten_column, read_archive, read_array, read_bytes
from jointsdf.shapes.labels.contents import describe_content
from jointsdf.shapes.labels.ids import check_ids
from jointsdf.shapes.labels.lengths import spread_labels
from jointsdf.shapes.labels.point_files import read_point_labels
from jointsdf.shapes.labels.text_files import read_json, read_text
from jointsdf.shapes.readers import abc_features
from jointsdf.shapes.readers.file_mesh import FileMesh
from jointsdf.shapes.readers.formats import LISTED, suffix_of

BREP, POINTS = ".seg", ".xyzc"
READERS: dict[str, Callable[[Path], Shaped[ndarray, "..."]]] = {
    ".npy": read_array,
    ".npz": read_archive,
    ".txt": read_text,
    ".csv": read_text,
    ".json": read_json,
    BREP: read_text,
}


def read_labels(path: Path, mesh: FileMesh, patches: Int[ndarray, " f"] | None = None) -> Int[ndarray, " f"]:
    """Read a label for each triangle of a mesh file.

    Args:
        path: `.npy`, `.npz`, `.txt`, `.csv`, `.json` or `.seg` (numbers from -1 to 2^31-1, as many as the mesh has
            triangles, polygons, vertices or B-rep faces, which `.seg` means first), `.xyzc` (labelled points on the
            surface), or an ABC features file.
        mesh: The mesh file, before any repair.
        patches: B-rep face of each triangle of a STEP file, else None.

    Raises:
        InputError: The file cannot be read, or is of another mesh. It says what the file is.
    """
    suffix, source = f".{suffix_of(path)}", f"labels file {path}"
    if path.suffix.lower() in abc_features.SUFFIXES:
        count = len(mesh.faces) if mesh.polygons is None else int(mesh.polygons.max()) + 1
        found = abc_features.read_features(path, count, len(mesh.vertices)).patches
        return found if mesh.polygons is None else found[mesh.polygons]
    if suffix == POINTS:
        return read_point_labels(path, mesh)
    if suffix not in READERS:
        raise InputError(
            f"{source} is {describe_content(read_bytes(path))}: read are {', '.join((*READERS, POINTS))}, ABC's .yml, "
            f"and columns of mesh files ({LISTED})"
        )
    labels = check_ids(source, flatten_column(source, READERS[suffix](path)))
    return spread_labels(source, labels, mesh, patches, patches_first=suffix == BREP)
