"""Where part labels come from: the values of `labels=`, each a function from a mesh to a part for each face."""

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
from jointsdf.shapes.labels import files as part_labels
from jointsdf.shapes.labels import partfield
from jointsdf.shapes.labels.face_matching import match_faces
from jointsdf.shapes.readers import abc_features as features
from jointsdf.shapes.readers import mesh_file as file
from jointsdf.shapes.segmentation.hierarchy import build_hierarchy
from jointsdf.values import UNLABELLED, LabelledMesh

Labels = tuple[Int[ndarray, " f"], str]


@dataclass(frozen=True)
class UnlabelledShape:
    """A mesh that labels are wanted for, and what the user said of them.

    Attributes:
        name: What messages call the mesh.
        written: The mesh as its file has it: label files follow its order.
        solid: The mesh as it will be used, with own labels or -1.
        kept: Index of each face of `solid` among those of `written`.
        beside: `labels.npy` beside the mesh file, whether it is there or not; None for a mesh without a file.
        patch_source: Where the B-rep patches are, or would be: a `.npy`, a features file, or the STEP file itself.
        patches: Of a STEP file's faces, in the order of `written`; None for any other mesh.
        known_as: Names that PartField may have given to the mesh.
        num_parts: Wanted number of parts, None where the provider is to choose.
        usual_parts: Number of parts that the geometric provider is to take then; None for the natural one.
        partfield_dir: PartField's output folder.
        needed: Whether missing patches are an error; if not, the mesh stays unlabelled.
    """

    name: str
    written: file.FileMesh
    solid: LabelledMesh
    kept: Int[ndarray, " f"]
    beside: Path | None = None
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
        return part_labels.numbered_by_area(shape.solid), "builtin"
    if shape.beside is not None and shape.beside.is_file():
        return from_file(shape, shape.beside)
    return geometric(shape)


def brep(shape: UnlabelledShape) -> Labels:
    """The B-rep patches, as they are."""
    _refuse_count(shape, "labels=brep gives the patches as they are")
    patches = _patches(shape)
    if patches is None and not shape.needed:
        return none(shape)
    if patches is None:
        missing = f"{shape.patch_source} not found" if shape.patch_source else f"{shape.name} has none"
        raise InputError(f"labels=brep: {missing}; give labels=<file.npy>, labels=geometric, or head=none")
    return patches[shape.kept], "brep"


def geometric(shape: UnlabelledShape) -> Labels:
    """Parts by the mesh's geometry; B-rep patches, where known, are never mixed before they are whole."""
    patches = None if shape.written.has_polygons else _patches(shape)
    found = build_hierarchy(shape.solid, None if patches is None else patches[shape.kept])
    labels = found.cut(shape.num_parts if shape.num_parts is not None else shape.usual_parts)
    return labels, f"geometric:k={labels.max() + 1}"


def from_partfield(shape: UnlabelledShape) -> Labels:
    """What PartField found, from its output folder."""
    _refuse_polygons(shape)
    corners = shape.written.vertices[shape.written.faces]
    labels, count = partfield.labels(shape.partfield_dir, shape.known_as, corners, shape.num_parts)
    return part_labels.numbered_by_area(replace(shape.solid, labels=labels[shape.kept])), f"partfield:k={count}"


def none(shape: UnlabelledShape) -> Labels:
    """No labels, even where some lie beside the mesh."""
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
    """The part of each face of `shape.solid`, and where it comes from: the provider and its setting.

    Args:
        labels: A provider's name or the path of a label file.
        shape: The mesh.

    Raises:
        InputError: `labels` is neither a provider nor an existing file, or the provider has nothing for this mesh.
    """
    if labels in PROVIDERS:
        return PROVIDERS[labels](shape)
    path = Path(labels).expanduser()
    if path.is_file():
        return from_file(shape, path)
    if path.suffix or len(path.parts) > 1:
        raise InputError(f"labels file not found: {labels}")
    near = get_close_matches(labels, PROVIDERS, n=1, cutoff=0.0)[0]
    raise InputError(f"unknown labels={labels!r}: give a label file or one of {', '.join(PROVIDERS)} (near: {near})")


def from_file(shape: UnlabelledShape, path: Path) -> Labels:
    """The labels in a file: `.npy`, `.txt`, an ABC features file, or a PLY with face labels or face colours.

    Raises:
        InputError: The file is of another mesh or damaged, or a number of parts was asked for.
    """
    _refuse_count(shape, f"labels file {path} gives its parts as they are")
    _refuse_polygons(shape)
    written, provider = shape.written, f"file:{path.name}"
    if path.suffix.lower() != ".ply":
        return _per_face(path, written)[shape.kept], provider
    mesh, labels, are_colours = file.read_labelled_ply(path)
    order = match_faces(f"labels file {path}", mesh.vertices[mesh.faces], written.vertices[written.faces])
    labels = labels[order][shape.kept]
    if are_colours:
        labels = part_labels.numbered_by_area(replace(shape.solid, labels=labels))
    return labels, provider


@cache
def benchmark() -> dict[str, int]:
    """Number of parts of each catalogue shape that the geometric provider cuts, chosen before any result was seen."""
    table = resources.files("jointsdf.shapes").joinpath("benchmark.csv").read_text(encoding="utf-8")
    return {row["shape"]: int(row["num_parts"]) for row in csv.DictReader(table.splitlines())}


def _patches(shape: UnlabelledShape) -> Int[ndarray, " g"] | None:
    """B-rep patch of each face of the file; None where none are known."""
    if shape.patches is not None:
        return shape.patches
    if shape.patch_source is None or not shape.patch_source.is_file():
        return None
    _refuse_polygons(shape)
    return _per_face(shape.patch_source, shape.written)


def _per_face(path: Path, written: file.FileMesh) -> Int[ndarray, " g"]:
    if path.suffix.lower() in features.SUFFIXES:
        return features.read(path, len(written.faces), len(written.vertices)).patches
    return part_labels.read(path, len(written.faces))


def _refuse_count(shape: UnlabelledShape, why: str) -> None:
    if shape.num_parts is not None:
        raise InputError(f"num_parts={shape.num_parts}: {why}; leave num_parts out, or give labels=geometric")


def _refuse_polygons(shape: UnlabelledShape) -> None:
    if shape.written.has_polygons:
        raise InputError(
            f"{shape.name} has polygons, so labels per face are ambiguous: triangulate it, one label per triangle"
        )
