"""Reader of glTF 2.0 files (glb, gltf): the triangles of all nodes of the default scene, in place.

Format: Khronos, "glTF 2.0 Specification". The library trimesh is not used: it leaves integers that are not normalised
as they are where KHR_mesh_quantization scales them, reads compressed meshes as zeros, and keeps the winding of mirrored
nodes.
"""

import logging
import re
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from jointsdf.errors import InputError, first_line
from jointsdf.shapes.readers.face_columns import COLOUR, number_colours
from jointsdf.shapes.readers.file_mesh import OWN_LABELS, FaceColumn, FileMesh, number_names
from jointsdf.shapes.readers.gltf_accessors import refusal
from jointsdf.shapes.readers.gltf_container import Container, open_container
from jointsdf.shapes.readers.gltf_json import entries, pick
from jointsdf.shapes.readers.gltf_primitives import Primitive, read_primitive
from jointsdf.shapes.readers.gltf_scene import INSTANCES, Placement, place_meshes
from jointsdf.values import UNLABELLED

UNDERSTOOD = ("KHR_mesh_quantization", INSTANCES)
OF_LOOKS = re.compile(r"(KHR|EXT|MSFT|ADOBE)_(materials|texture|lights|xmp|animation|environment)_?\w*")
OWN_NODE = re.compile(r"part_(0|[1-9]\d{0,9})|unlabelled")
MOST_TRIANGLES = 100_000_000  # of all instances together: a small file can place a mesh any number of times

logger = logging.getLogger(__name__)

Piece = tuple[Primitive, Placement]


def read_gltf(path: Path, data: bytes) -> FileMesh:
    """Read a glTF file: mesh by mesh, each by its primitives, and each of these by the nodes that place it.

    Columns are `node` (the nearest name), `mesh`, and where there are materials or colours `material` and `colour`;
    `label`, where every node has the name of a part as this program writes it.

    Args:
        path: Names the file in messages; buffers may be files beside it.
        data: Its content.

    Raises:
        InputError: It is damaged, compressed, needs an unknown extension, or holds no triangles.
    """
    try:
        file = open_container(path, data)
        _refuse_extensions(str(path), file)
        placements, frame = place_meshes(file)
        placements = _leave_out_flattened(str(path), placements)
        pieces = _collect_pieces(str(path), file, placements)
    except InputError:
        raise
    except (ValueError, OverflowError) as error:
        kind = "glb" if ".glb" in path.name.lower() else "gltf"
        raise InputError(f"{path} cannot be read as {kind}: {first_line(error)}; export it again") from error
    _warn_of_left_out(str(path), file, placements)
    vertices, faces = _join(pieces)
    return FileMesh(vertices, faces, file.sha256, columns=_collect_columns(pieces), unit=frame.unit, up=frame.up)


def _refuse_extensions(source: str, file: Container) -> None:
    """Refuse a file that cannot be read without an extension other than the understood ones, or those of looks."""
    required = file.document.get("extensionsRequired", [])
    if not isinstance(required, list):
        raise ValueError("extensionsRequired is no list")
    for name in map(str, required):
        if name not in UNDERSTOOD and not OF_LOOKS.fullmatch(name):
            raise refusal(source, name)


def _leave_out_flattened(source: str, placements: list[Placement]) -> list[Placement]:
    """Leave out what a scale of 0 flattens, as exporters write it to hide a mesh."""
    kept = [each for each in placements if np.linalg.matrix_rank(each.world[:3, :3]) == 3]
    if len(kept) < len(placements):
        count = len(placements) - len(kept)
        logger.warning("%s: %d nodes that flatten their mesh by a scale of 0 are left out", source, count)
    return kept


def _collect_pieces(source: str, file: Container, placements: list[Placement]) -> list[Piece]:
    """Read each primitive once, and list it for each node that places it."""
    by_mesh: dict[int, list[Placement]] = {}
    for placement in placements:
        pick(file.document, "meshes", placement.mesh)
        by_mesh.setdefault(placement.mesh, []).append(placement)
    pieces: list[Piece] = []
    total, others = 0, 0
    for mesh in sorted(by_mesh):
        for primitive in entries(pick(file.document, "meshes", mesh), "primitives"):
            found = read_primitive(source, file, primitive)
            if found is None:
                others += 1
                continue
            total += len(found.triangles) * len(by_mesh[mesh])
            if total > MOST_TRIANGLES:
                raise InputError(f"{source} places more than {MOST_TRIANGLES} triangles: export fewer or coarser ones")
            pieces += [(found, placement) for placement in by_mesh[mesh]]
    if not pieces:
        what = "its scene holds only points or lines" if others else "its scene places no mesh"
        raise InputError(f"{source} has no faces: {what}; export a triangle mesh")
    if others:
        logger.warning("%s: %d primitives of points or lines are left out", source, others)
    return pieces


def _warn_of_left_out(source: str, file: Container, placements: list[Placement]) -> None:
    """Warn of scenes that are not read, and of deformations."""
    if (scenes := len(entries(file.document, "scenes"))) > 1:
        logger.warning("%s: of its %d scenes only the default one is read", source, scenes)
    nodes = entries(file.document, "nodes")
    skinned = any("skin" in nodes[each.node] for each in placements if nodes)
    meshes = [pick(file.document, "meshes", each) for each in sorted({each.mesh for each in placements})]
    if skinned or any("targets" in primitive for mesh in meshes for primitive in entries(mesh, "primitives")):
        logger.warning("%s: skins and morph targets are not applied, the mesh is read at rest", source)


def _join(pieces: list[Piece]) -> tuple[Float[ndarray, "v 3"], Int[ndarray, "f 3"]]:
    """Place all pieces in the file frame; a mirrored piece is wound the other way round."""
    vertices, faces, count = [], [], 0
    with np.errstate(invalid="ignore", over="ignore"):  # of infinite coordinates, which are refused later
        for primitive, placement in pieces:
            # Element by element: a matrix product may round equal positions apart, and the mesh would come open.
            x, y, z = (primitive.positions[:, [axis]] * placement.world[:3, axis] for axis in range(3))
            vertices.append(x + y + z + placement.world[:3, 3])
            mirrored = np.linalg.det(placement.world[:3, :3]) < 0
            faces.append(primitive.triangles[:, :: -1 if mirrored else 1] + count)
            count += len(primitive.positions)
    return np.concatenate(vertices), np.concatenate(faces)


def _collect_columns(pieces: list[Piece]) -> dict[str, FaceColumn]:
    """Columns of the triangles."""
    sizes = [len(primitive.triangles) for primitive, _ in pieces]

    def column(values: list[str] | list[int]) -> FaceColumn:
        return FaceColumn(number_names(np.repeat(number_names(np.array(values)), sizes)), False)

    columns = {
        "node": column([placement.name for _, placement in pieces]),
        "mesh": column([placement.mesh for _, placement in pieces]),
    }
    if any(primitive.material for primitive, _ in pieces):
        columns["material"] = column([primitive.material for primitive, _ in pieces])
    if any(primitive.is_coloured for primitive, _ in pieces):
        colours = np.concatenate([primitive.colours for primitive, _ in pieces])
        columns[COLOUR] = FaceColumn(number_colours(colours), False)
    own = [OWN_NODE.fullmatch(placement.own_name) for _, placement in pieces]
    if all(own):
        labels = [int(found[1]) if found and found[1] else UNLABELLED for found in own]
        columns[OWN_LABELS] = FaceColumn(np.repeat(np.array(labels, dtype=np.int64), sizes), True)
    return columns
