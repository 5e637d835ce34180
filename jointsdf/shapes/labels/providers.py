"""Providers of part labels: the values of `labels=`, each a function from a mesh to a part for each face."""

import csv
from collections.abc import Callable
from dataclasses import dataclass, replace
from difflib import get_close_matches
from functools import cache
from importlib import resources
from pathlib import Path

import numpy as np
from jaxtyping import Int
from numpy import ndarray

from jointsdf.errors import InputError
from jointsdf.shapes.labels import partfield
from jointsdf.shapes.labels.face_matching import match_faces
from jointsdf.shapes.labels.files import number_by_area, read_labels
from jointsdf.shapes.readers import abc_features
from jointsdf.shapes.readers.file_mesh import FileMesh
from jointsdf.shapes.readers.mesh_file import read_labelled_ply
from jointsdf.shapes.segmentation.hierarchy import build_hierarchy
from jointsdf.user_paths import expand_home
from jointsdf.values import UNLABELLED, LabelledMesh

Labels = tuple[Int[ndarray, " f"], str]


@dataclass(frozen=True)
class UnlabelledShape:
    """A mesh that needs labels, and their possible sources.

    Attributes:
        name: Of the mesh in messages.
        file_mesh: The mesh in its file: label files follow its order.
        solid: The repaired mesh, with own labels or -1.
        source_faces: Index of each face of `solid` among those of `file_mesh`.
        labels_path: Label file beside the mesh file; None where there is none.
        patch_source: File of the B-rep patches, existing or not: a `.npy`, a features file, or the STEP file itself.
        patches: Of a STEP file's faces, in the order of `file_mesh`; None for any other mesh.
        known_as: Names that PartField may have given to the mesh.
        num_parts: Wanted number of parts, None to let the provider choose.
        usual_parts: Number of parts that the geometric provider chooses; None for the natural one.
        partfield_dir: PartField's output folder.
        needed: Whether missing patches are an error; otherwise the mesh stays unlabelled.
    """

    name: str
    file_mesh: FileMesh
    solid: LabelledMesh
    source_faces: Int[ndarray, " f"]
    labels_path: Path | None = None
    patch_source: Path | None = None
    patches: Int[ndarray, " g"] | None = None
    known_as: tuple[str, ...] = ()
    num_parts: int | None = None
    usual_parts: int | None = None
    partfield_dir: Path | None = None
    needed: bool = True


def auto(shape: UnlabelledShape) -> Labels:
    """The mesh's own labels, `labels.npy` beside it, else parts by its geometry."""
    if len(shape.solid.part_ids):
        _refuse_count(shape, f"{shape.name} has its own labels")
        return number_by_area(shape.solid), "builtin"
    if shape.labels_path is not None and shape.labels_path.is_file():
        return from_file(shape, shape.labels_path)
    return geometric(shape)


def brep(shape: UnlabelledShape) -> Labels:
    """The B-rep patches, unchanged."""
    _refuse_count(shape, "labels=brep gives the patches as they are")
    patches = _find_patches(shape)
    if patches is None and not shape.needed:
        return none(shape)
    if patches is None:
        missing = f"{shape.patch_source} not found" if shape.patch_source else f"{shape.name} has none"
        raise InputError(f"labels=brep: {missing}; give labels=<file.npy>, labels=geometric, or head=none")
    return patches[shape.source_faces], "brep"


def geometric(shape: UnlabelledShape) -> Labels:
    """Parts by the mesh's geometry, merged from whole B-rep patches where these are known."""
    patches = None if shape.file_mesh.has_polygons else _find_patches(shape)
    found = build_hierarchy(shape.solid, None if patches is None else patches[shape.source_faces])
    labels = found.cut(shape.num_parts if shape.num_parts is not None else shape.usual_parts)
    return labels, f"geometric:k={labels.max() + 1}"


def from_partfield(shape: UnlabelledShape) -> Labels:
    """Parts from PartField's output folder."""
    _refuse_polygons(shape)
    corners = shape.file_mesh.vertices[shape.file_mesh.faces]
    labels, count = partfield.read_parts(shape.partfield_dir, shape.known_as, corners, shape.num_parts)
    return number_by_area(replace(shape.solid, labels=labels[shape.source_faces])), f"partfield:k={count}"


def none(shape: UnlabelledShape) -> Labels:
    """No labels, even where there are some beside the mesh."""
    _refuse_count(shape, "labels=none gives no parts")
    return np.full(len(shape.solid.faces), UNLABELLED), "none"


PROVIDERS: dict[str, Callable[[UnlabelledShape], Labels]] = {
    "auto": auto,
    "geometric": geometric,
    "partfield": from_partfield,
    "brep": brep,
    "none": none,
}


def provide(labels: str, shape: UnlabelledShape) -> Labels:
    """Label the faces of `shape.solid` by a provider or a file.

    Args:
        labels: A provider's name or the path of a label file.
        shape: The mesh.

    Returns:
        The part of each face, and the provider with its setting.

    Raises:
        InputError: `labels` is neither a provider nor an existing file, or the provider has nothing for this mesh.
    """
    if labels in PROVIDERS:
        return PROVIDERS[labels](shape)
    path = Path(expand_home(labels))
    if path.is_file():
        return from_file(shape, path)
    if path.suffix or len(path.parts) > 1:
        raise InputError(f"labels file not found: {labels}")
    near = get_close_matches(labels, PROVIDERS, n=1, cutoff=0.0)[0]
    raise InputError(f"unknown labels={labels!r}: give a label file or one of {', '.join(PROVIDERS)} (near: {near})")


def from_file(shape: UnlabelledShape, path: Path) -> Labels:
    """Read the labels in a file: `.npy`, `.txt`, an ABC features file, or a PLY with face labels or face colours.

    Raises:
        InputError: The file is of another mesh or damaged, or the user gave a number of parts.
    """
    _refuse_count(shape, f"labels file {path} gives its parts as they are")
    _refuse_polygons(shape)
    file_mesh, provider = shape.file_mesh, f"file:{path.name}"
    if path.suffix.lower() != ".ply":
        return _read_per_face(path, file_mesh)[shape.source_faces], provider
    mesh, labels, are_colours = read_labelled_ply(path)
    order = match_faces(f"labels file {path}", mesh.vertices[mesh.faces], file_mesh.vertices[file_mesh.faces])
    labels = labels[order][shape.source_faces]
    if are_colours:
        labels = number_by_area(replace(shape.solid, labels=labels))
    return labels, provider


@cache
def benchmark() -> dict[str, int]:
    """Number of parts of each catalogue shape that the geometric provider cuts, chosen before any result was seen."""
    table = resources.files("jointsdf.shapes").joinpath("benchmark.csv").read_text(encoding="utf-8")
    return {row["shape"]: int(row["num_parts"]) for row in csv.DictReader(table.splitlines())}


def _find_patches(shape: UnlabelledShape) -> Int[ndarray, " g"] | None:
    """Find the B-rep patch of each face of the file; None where none are known."""
    if shape.patches is not None:
        return shape.patches
    if shape.patch_source is None or not shape.patch_source.is_file():
        return None
    _refuse_polygons(shape)
    return _read_per_face(shape.patch_source, shape.file_mesh)


def _read_per_face(path: Path, file_mesh: FileMesh) -> Int[ndarray, " g"]:
    if path.suffix.lower() in abc_features.SUFFIXES:
        return abc_features.read_features(path, len(file_mesh.faces), len(file_mesh.vertices)).patches
    return read_labels(path, len(file_mesh.faces))


def _refuse_count(shape: UnlabelledShape, why: str) -> None:
    if shape.num_parts is not None:
        raise InputError(f"num_parts={shape.num_parts}: {why}; leave num_parts out, or give labels=geometric")


def _refuse_polygons(shape: UnlabelledShape) -> None:
    if shape.file_mesh.has_polygons:
        raise InputError(
            f"{shape.name} has polygons, so labels per face are ambiguous: triangulate it, one label per triangle"
        )
