"""Reader of mesh files (ply, obj, stl, off, glb) as triangles in the file's order, which reports any damage.

It also reads the part labels or colours of a PLY's faces, and the content of a STEP file for the B-rep reader.
"""

import hashlib
import io
import re
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from jaxtyping import Float, Int
from numpy import ndarray

from jointsdf.errors import InputError
from jointsdf.shapes.readers.file_mesh import FileMesh, check_mesh
from jointsdf.values import UNLABELLED

FORMATS = ("ply", "obj", "stl", "off", "glb", "step", "stp")
OFF_HEADER = 4096  # bytes within which an OFF file declares its sizes
STL_HEADER, STL_FACE = 84, 50  # bytes of a binary STL file: up to and with the number of faces, and of each face


def read_mesh(path: Path) -> FileMesh:
    """Read a mesh file without repairs.

    Args:
        path: A ply, obj, stl, off or glb file. Several meshes in one file are joined in the file's order.

    Raises:
        InputError: The file is missing, empty, truncated, unreadable or of another format, has no faces, a
            NaN or infinite vertex, or a face that uses a vertex out of range.
    """
    data = read_content(path)
    vertices, faces, declared = _parse(path, data)
    if declared is not None and declared > len(faces):
        raise InputError(f"{path} is truncated: it declares {declared} faces and holds {len(faces)}; export it again")
    check_mesh(str(path), vertices, faces)
    polygons = np.arange(len(faces)) if declared is not None and declared < len(faces) else None
    return FileMesh(vertices, faces, hashlib.sha256(data).hexdigest(), polygons)


def read_labelled_ply(path: Path) -> tuple[FileMesh, Int[ndarray, " f"], bool]:
    """Read a PLY file with a part for each face.

    The integer face property `label` takes precedence over face colours, of which each distinct one (without opacity)
    is a part.

    Returns:
        The mesh, the parts, and whether they are colours.

    Raises:
        InputError: The mesh cannot be read, has polygons, or has neither property.
    """
    mesh = read_mesh(path)
    if mesh.has_polygons:
        raise InputError(f"{path} has polygons: triangulate it, so that each triangle has its label")
    try:
        raw = trimesh.load_mesh(io.BytesIO(path.read_bytes()), file_type="ply", process=False).metadata["_ply_raw"]
        columns = {
            name: np.asarray(raw["face"]["data"][name]).ravel() for name in _face_properties(raw["face"]["data"])
        }
    except Exception as error:  # on a damaged file a parser may fail in any way
        raise InputError(f"{path} cannot be read as ply (truncated or damaged?): export it again") from error
    if "label" in columns:
        labels = columns["label"]
        if labels.dtype.kind not in "iu" or (labels.size and labels.min() < UNLABELLED):
            raise InputError(f"{path}: its face property label must be an integer >= -1, where -1 means unlabelled")
        return mesh, labels.astype(np.int64), False
    if not columns.keys() >= {"red", "green", "blue"}:
        raise InputError(f"{path} has no part labels: it needs an integer face property label, or face colours")
    colours = np.stack([columns[name] for name in ("red", "green", "blue")], axis=1)
    return mesh, np.unique(colours, axis=0, return_inverse=True)[1].reshape(-1).astype(np.int64), True


def _face_properties(data: Any) -> list[str]:
    """Names of label and colour properties in the parsed face element of a PLY: a record array, or a dict for text."""
    names = data.keys() if isinstance(data, dict) else data.dtype.names
    return [name for name in ("label", "red", "green", "blue") if name in names]


def read_content(path: Path) -> bytes:
    """Read a file's content, after checking that it is a non-empty file of a known format.

    Raises:
        InputError: The file is missing, a folder, empty, unreadable or of another format.
    """
    if not path.exists():
        raise InputError(f"file not found: {path}")
    if path.is_dir():
        raise InputError(f"{path} is a folder: give the mesh file in it")
    if path.suffix.lower().lstrip(".") not in FORMATS:
        raise InputError(
            f"{path}: format {path.suffix or 'without suffix'} is not read; use one of {', '.join(FORMATS)}"
        )
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path} cannot be opened: {error.strerror}") from error
    if not data.strip():
        raise InputError(f"{path} is empty (0 bytes of mesh): export it again")
    return data


def _parse(path: Path, data: bytes) -> tuple[Float[ndarray, "v 3"], Int[ndarray, "f 3"], int | None]:
    """Parse vertices, triangles in the file's order, and the number of faces that the file declares (None without)."""
    kind = path.suffix.lower().lstrip(".")
    try:
        if kind == "obj":
            return _parse_obj(data)
        declared = _declared_faces(kind, data)
        scene = trimesh.load_scene(io.BytesIO(data), file_type=kind, process=False)
    except Exception as error:  # on a damaged file a parser may fail in any way
        raise InputError(f"{path} cannot be read as {kind} (truncated or damaged?): export it again") from error
    vertices, faces, count = [np.zeros((0, 3))], [np.zeros((0, 3), dtype=np.int64)], 0
    for name, geometry in scene.geometry.items():
        if not isinstance(geometry, trimesh.Trimesh):
            continue
        for node in scene.graph.geometry_nodes[name]:
            placed = trimesh.transform_points(geometry.vertices, scene.graph[node][0])
            vertices.append(np.asarray(placed, dtype=np.float64))
            faces.append(np.asarray(geometry.faces, dtype=np.int64).reshape(-1, 3) + count)
            count += len(placed)
    return np.concatenate(vertices), np.concatenate(faces), declared


def _parse_obj(data: bytes) -> tuple[Float[ndarray, "v 3"], Int[ndarray, "f 3"], int]:
    """Parse an OBJ file. Differs from trimesh, which reorders faces by material and format."""
    vertices: list[list[float]] = []
    faces: list[list[int]] = []
    declared = 0
    for line in data.decode("utf-8", errors="replace").splitlines():
        key, *words = line.split() or [""]
        if key == "v":
            x, y, z = (float(word) for word in words[:3])
            vertices.append([x, y, z])
        elif key == "f":
            declared += 1
            written = [int(word.split("/")[0]) for word in words]
            corners = [i - 1 if i > 0 else len(vertices) + i if i < 0 else -1 for i in written]
            if len(corners) < 3:
                raise ValueError(f"a face of {len(corners)} vertices")
            faces.extend([corners[0], b, c] for b, c in pairwise(corners[1:]))
    return np.array(vertices).reshape(-1, 3), np.array(faces, dtype=np.int64).reshape(-1, 3), declared


def _declared_faces(kind: str, data: bytes) -> int | None:
    """Number of faces that the file declares; parsers accept text files that end early."""
    if kind == "ply":
        found = re.search(rb"element\s+face\s+(\d+)", data.partition(b"end_header")[0])
        return int(found[1]) if found else None
    if kind == "off":
        words = re.sub(rb"#[^\n]*", b"", data[:OFF_HEADER]).split()
        return int(words[2])
    if kind == "stl" and len(data) != STL_HEADER + STL_FACE * int.from_bytes(data[80:STL_HEADER], "little"):
        if not re.search(rb"endsolid[^\n]*\s*$", data, re.IGNORECASE):
            raise ValueError("neither a whole binary STL nor a whole text STL")
        return len(re.findall(rb"facet\s+normal", data, re.IGNORECASE))
    return None
