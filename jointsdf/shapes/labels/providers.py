"""Providers of part labels: the values of `labels=`, each a function from a mesh to a part for each face."""

import csv
import logging
from collections.abc import Callable
from dataclasses import replace
from difflib import get_close_matches
from functools import cache
from importlib import resources
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from jointsdf.errors import InputError
from jointsdf.geometry.mesh import face_areas
from jointsdf.shapes.labels import partfield
from jointsdf.shapes.labels.columns import split_column, suggest_columns
from jointsdf.shapes.labels.files import read_labels
from jointsdf.shapes.labels.given import find_own, from_file
from jointsdf.shapes.labels.ids import number_by_area
from jointsdf.shapes.labels.unlabelled import Labels, UnlabelledShape
from jointsdf.shapes.segmentation.hierarchy import MOST, Hierarchy, build_hierarchy
from jointsdf.values import UNLABELLED

OWN = "own"  # provider of what the mesh brings
SLIVER, WHOLE = 0.01, 0.9  # shares of the area: a part below is hardly one; beside a part above, nothing is divided

logger = logging.getLogger(__name__)


def auto(shape: UnlabelledShape) -> Labels:
    """The mesh's own labels, those in its file, `labels.npy` beside it, else parts by its geometry."""
    if len(shape.solid.part_ids):
        shape.refuse_count(f"{shape.name} has its own labels")
        return number_by_area(shape.solid), "builtin"
    if found := find_own(shape):
        return found
    if suggestion := suggest_columns(shape.name, shape.file_mesh):
        logger.warning("%s", suggestion)
    return geometric(shape)


def own(shape: UnlabelledShape) -> Labels:
    """The mesh's own labels, those in its file or beside it, else none."""
    if len(shape.solid.part_ids):
        return number_by_area(shape.solid), "builtin"
    return find_own(shape) or none(shape)


def brep(shape: UnlabelledShape) -> Labels:
    """The B-rep patches, unchanged."""
    shape.refuse_count("labels=brep gives the patches as they are")
    patches = _find_patches(shape)
    if patches is None and not shape.needed:
        return none(shape)
    if patches is None:
        missing = f"{shape.patch_source} not found" if shape.patch_source else f"{shape.name} has none"
        raise InputError(f"labels=brep: {missing}; give labels=<file.npy>, labels=geometric, or head=none")
    return patches[shape.source_faces], "brep"


def geometric(shape: UnlabelledShape) -> Labels:
    """Parts by the mesh's geometry, merged from whole B-rep patches where these are known."""
    patches = _find_patches(shape)
    found = build_hierarchy(shape.solid, None if patches is None else patches[shape.source_faces])
    labels = found.cut(shape.num_parts if shape.num_parts is not None else shape.usual_parts)
    if shape.num_parts is not None or shape.usual_parts is None:
        _warn_of_slivers(shape, found, labels)
    return labels, f"geometric:k={labels.max() + 1}"


def from_partfield(shape: UnlabelledShape) -> Labels:
    """Parts from PartField's output folder."""
    labels, count = partfield.read_parts(shape.partfield_dir, shape.known_as, shape.file_mesh, shape.num_parts)
    return number_by_area(replace(shape.solid, labels=labels[shape.source_faces])), f"partfield:k={count}"


def none(shape: UnlabelledShape) -> Labels:
    """No labels, even where there are some beside the mesh."""
    shape.refuse_count("labels=none gives no parts")
    return np.full(len(shape.solid.faces), UNLABELLED), "none"


PROVIDERS: dict[str, Callable[[UnlabelledShape], Labels]] = {
    "auto": auto,
    "geometric": geometric,
    "partfield": from_partfield,
    "brep": brep,
    "none": none,
    OWN: own,
}


def provide(labels: str, shape: UnlabelledShape) -> Labels:
    """Label the faces of `shape.solid` by a provider or a file.

    Args:
        labels: A provider's name, the path of a label file, or `<mesh file>:<column>`.
        shape: The mesh.

    Returns:
        The part of each face, and the provider with its setting.

    Raises:
        InputError: `labels` is neither a provider nor an existing file, or the provider has nothing for this mesh.
    """
    if labels in PROVIDERS:
        return PROVIDERS[labels](shape)
    if given := split_column(labels):
        return from_file(shape, *given)
    if Path(labels).suffix or len(Path(labels).parts) > 1:
        raise InputError(f"labels file not found: {labels}")
    near = get_close_matches(labels, PROVIDERS, n=1, cutoff=0.0)[0]
    raise InputError(f"unknown labels={labels!r}: give a label file or one of {', '.join(PROVIDERS)} (near: {near})")


def absolute(labels: str) -> str:
    """The same value of `labels=` for any working directory: the path of a file, with its column, in full."""
    given = None if labels in PROVIDERS else split_column(labels)
    if given is None:
        return labels
    path, column = given
    return f"{path.resolve()}:{column}" if column else str(path.resolve())


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
    return read_labels(shape.patch_source, shape.file_mesh)


def _warn_of_slivers(shape: UnlabelledShape, found: Hierarchy, labels: Int[ndarray, " f"]) -> None:
    """Warn where nearly all of the area stays in one part, and others have next to none; name better numbers of parts.

    With the benchmark's numbers this is so for one of its 50 shapes (`abc_0042`), and for no built-in part.
    """
    shares = _shares(shape, labels)
    few = int((shares < SLIVER).sum())
    if not few or shares.max() <= WHOLE:
        return
    divided = next(
        (k for k in range(2, min(MOST, len(found.areas)) + 1) if _shares(shape, found.cut(k)).max() <= WHOLE), 0
    )
    logger.warning(
        "%s: its %d parts by geometry leave %.1f%% of the area in one, and %d have less than %g%%; num_parts=%d is "
        "natural%s",
        *(shape.name, len(shares), 100 * shares.max(), few, 100 * SLIVER, found.natural_parts),
        f"; from num_parts={divided} on no part has over {100 * WHOLE:g}%" if divided else "",
    )


def _shares(shape: UnlabelledShape, labels: Int[ndarray, " f"]) -> Float[ndarray, " k"]:
    """Share of the area that each part has."""
    areas: Float[ndarray, " k"] = np.bincount(labels, face_areas(shape.solid))
    return areas / areas.sum()
