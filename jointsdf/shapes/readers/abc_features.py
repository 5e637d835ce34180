"""Reader of the features file that ABC distributes with each obj mesh: B-rep patches, surface types, sharp edges.

Source: Koch et al., "ABC: A Big CAD Model Dataset For Geometric Deep Learning", CVPR 2019.
"""

import logging
import re
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from jaxtyping import Int
from numpy import ndarray
from yaml.events import CollectionEndEvent, CollectionStartEvent, MappingEndEvent, NodeEvent, ScalarEvent

from jointsdf.errors import InputError
from jointsdf.values import UNLABELLED

SUFFIXES = (".yml", ".yaml")
DEEPEST = 20  # levels of nesting; the files have six
MISSING = -1  # vertex of a curve that ABC's meshing did not find
MOST_DIGITS = 18  # of an index: they fit 64 bits
ABC_OBJ = re.compile(r"(\d{8}_[0-9a-f]{24})_trimesh_(\d+)\.obj(\.gz)?", re.IGNORECASE)

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class Features:
    """Features of one ABC obj mesh, by the indices of the obj file.

    Attributes:
        patches: The B-rep patch of each face, -1 where none.
        surfaces: Type of each patch: plane, cylinder, cone, sphere, torus, bspline, revolution, extrusion, or other.
        sharp_edges: Ends of each mesh edge on a sharp curve, each edge once, the smaller vertex index first.
    """

    patches: Int[ndarray, " f"]
    surfaces: tuple[str, ...]
    sharp_edges: Int[ndarray, "e 2"]


def find_features_file(mesh_path: Path) -> Path | None:
    """Find the features file of an ABC obj mesh in its folder, by the ABC id; None for any other mesh."""
    named = ABC_OBJ.fullmatch(mesh_path.name)
    if not named:
        return None
    same_number = mesh_path.with_name(f"{named[1]}_features_{named[2]}.yml")
    others = sorted(mesh_path.parent.glob(f"{named[1]}_features_*.yml"))
    return same_number if same_number in others else next(iter(others), None)


def read_features(path: Path, num_faces: int, num_vertices: int) -> Features:
    """Read the features of a mesh.

    Args:
        path: The features file.
        num_faces: Faces of the obj FILE that it belongs to.
        num_vertices: Vertices of that file.

    Raises:
        InputError: The file cannot be opened, is empty, truncated, damaged, no features file, holds YAML tags or
            references, names a face or vertex that the mesh does not have, or puts a face in two patches.
    """
    document = _read_document(path)
    patches = np.full(num_faces, UNLABELLED)
    surfaces = []
    for patch, surface in enumerate(_check_entries(path, document, "surfaces", ("face_indices", "type"))):
        members = _parse_indices(path, surface["face_indices"], num_faces, "face")
        if (patches[members] != UNLABELLED).any() or len(np.unique(members)) < len(members):
            raise InputError(f"{path} puts a face in more than one patch: it is damaged, extract it again")
        patches[members] = patch
        surfaces.append(str(surface["type"]).lower())
    if without := int((patches == UNLABELLED).sum()):
        logger.warning("%s: %d of %d faces are in no patch and stay unlabelled", path, without, num_faces)
    curves = _check_entries(path, document, "curves", ("vert_indices", "sharp"))
    sharp = [
        _parse_indices(path, curve["vert_indices"], num_vertices, "vertex", some_missing=True)
        for curve in curves
        if curve["sharp"] == "true"
    ]
    if holed := sum(bool((curve == MISSING).any()) for curve in sharp):
        logger.warning("%s: %d curves have vertices %d, which no mesh has: left out", path, holed, MISSING)
    edges = np.array([edge for curve in sharp for edge in pairwise(curve.tolist())], dtype=np.int64).reshape(-1, 2)
    edges = np.sort(edges[(edges[:, 0] != edges[:, 1]) & (edges != MISSING).all(axis=1)], axis=1)
    return Features(patches, tuple(surfaces), np.unique(edges, axis=0))


def _read_document(path: Path) -> dict[Any, Any]:
    """Read and parse the file."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"features file {path} cannot be opened: {error.strerror}") from error
    if not data.strip():
        raise InputError(f"features file {path} is empty: extract it again")
    try:
        document = _parse_yaml(data)
    except (yaml.YAMLError, UnicodeDecodeError, TypeError) as error:
        raise InputError(f"features file {path} is truncated or damaged: extract it again") from error
    except ValueError as error:
        raise InputError(f"{path} is no ABC features file: {error}") from error
    if not isinstance(document, dict):
        raise InputError(f"{path} is no ABC features file: it has no lists of surfaces and curves")
    return document


def _parse_yaml(data: bytes) -> Any:
    """Parse a document into lists, mappings and words.

    It is built from the parser's events, so that a hostile file does no harm: no tag makes an object, no reference
    multiplies, and no deep nesting overflows the stack, all of which the library's loader allows.
    """
    stack: list[list[Any]] = [[]]
    for event in yaml.parse(data, Loader=yaml.CSafeLoader):
        if isinstance(event, NodeEvent) and (event.anchor or getattr(event, "tag", None)):
            raise ValueError("it holds YAML tags or references")
        if isinstance(event, ScalarEvent):
            stack[-1].append(event.value)
        elif isinstance(event, CollectionStartEvent):
            if len(stack) > DEEPEST:
                raise ValueError(f"it is nested deeper than {DEEPEST} levels")
            stack.append([])
        elif isinstance(event, CollectionEndEvent):
            items = stack.pop()
            is_mapping = isinstance(event, MappingEndEvent)
            stack[-1].append(dict(zip(items[::2], items[1::2], strict=True)) if is_mapping else items)
    return stack[0][0] if stack[0] else None


def _check_entries(path: Path, document: dict[Any, Any], key: str, fields: tuple[str, ...]) -> list[dict[str, Any]]:
    """Check one of the file's two lists: each entry has every field that is needed."""
    entries = document.get(key)
    if not isinstance(entries, list):
        raise InputError(f"{path} is no ABC features file, or truncated: it has no list of {key}")
    for number, entry in enumerate(entries):
        missing = [field for field in fields if not isinstance(entry, dict) or field not in entry]
        if missing:
            raise InputError(f"features file {path} is truncated or damaged: {key}[{number}] has no {missing[0]}")
    return entries


def _parse_indices(
    path: Path, given: object, count: int, kind: str, *, some_missing: bool = False
) -> Int[ndarray, " n"]:
    """Parse a list of indices below `count`; of some also -1."""
    missing = (str(MISSING),) if some_missing else ()
    if not isinstance(given, list) or not all(
        isinstance(word, str) and (word.isdecimal() or word in missing) for word in given
    ):
        raise InputError(f"features file {path} is damaged: {kind} indices are not a list of integers >= 0")
    outside = next((word for word in given if len(word) > MOST_DIGITS or int(word) >= count), None)
    if outside is not None:
        raise InputError(f"{path} names {kind} {outside[:20]}, the mesh has 0..{count - 1}: it is of another mesh")
    return np.array([int(word) for word in given], dtype=np.int64)
