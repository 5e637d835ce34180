"""Scene graph of a glTF file: where each node places its mesh, the unit of length and the axis that points up.

Format: Khronos, "glTF 2.0 Specification", section 3.5 (scenes, nodes, transformations); EXT_mesh_gpu_instancing.
"""

import math
import re
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from jointsdf.shapes.readers.gltf_accessors import read_accessor
from jointsdf.shapes.readers.gltf_container import Container
from jointsdf.shapes.readers.gltf_json import Json, entries, indices, integer, name_of, nested, numbers, pick
from jointsdf.values import Unit

FILE_UNITS = "file_units"  # root node of a file that this program wrote: it maps the file frame to metres, Y up
INSTANCES = "EXT_mesh_gpu_instancing"
IDENTITY = tuple(np.eye(4).ravel().tolist())


class Frame(NamedTuple):
    """The file frame: its length unit, and its axis that points up, `y` or `z`."""

    unit: Unit
    up: str


METRES_Y_UP = Frame(Unit("m", 1.0), "y")  # of any file that this program did not write


class Placement(NamedTuple):
    """One use of a mesh by a node.

    Attributes:
        node: Index of the node.
        mesh: Index of the mesh.
        world: From the mesh's frame to the file frame, homogeneous.
        own_name: Name of the node, "" without.
        name: Of the nearest node with a name, from the node up to the root.
    """

    node: int
    mesh: int
    world: Float[ndarray, "4 4"]
    own_name: str
    name: str


def place_meshes(file: Container) -> tuple[list[Placement], Frame]:
    """Place the meshes of the default scene, in the order of the nodes.

    Without a default, that is the first scene; without scenes, all nodes; without nodes, the meshes themselves.

    Returns:
        The placements, and the file frame: glTF's own, or that which this program wrote.

    Raises:
        ValueError: A node is damaged, in a cycle, or the child of two nodes.
    """
    nodes, roots = entries(file.document, "nodes"), _find_roots(file.document)
    if not nodes and not entries(file.document, "scenes"):
        meshes = range(len(entries(file.document, "meshes")))
        return [Placement(mesh, mesh, np.eye(4), "", "") for mesh in meshes], METRES_Y_UP
    frame = _written_frame(file.document)
    is_own = frame is not None and len(roots) == 1 and name_of(pick(file.document, "nodes", roots[0])) == FILE_UNITS
    placements: list[Placement] = []
    seen: set[int] = set()
    waiting = [(root, np.eye(4), "") for root in roots]
    while waiting:
        index, parent, inherited = waiting.pop()
        node = pick(file.document, "nodes", index)
        if index in seen:
            raise ValueError(f"node {index} is in a cycle, or is the child of two nodes")
        seen.add(index)
        world = parent if is_own and index == roots[0] else parent @ _local_matrix(node)
        name = name_of(node) or inherited
        waiting += [(child, world, name) for child in indices(node, "children")]
        if "mesh" in node:
            for matrix in _instance_matrices(file, node):
                placements.append(Placement(index, integer(node, "mesh"), world @ matrix, name_of(node), name))
    return sorted(placements, key=lambda each: each.node), frame if is_own and frame else METRES_Y_UP


def _find_roots(document: Json) -> list[int]:
    """Root nodes of the scene that is shown."""
    if entries(document, "scenes"):
        return indices(pick(document, "scenes", document.get("scene", 0)), "nodes")
    nodes = entries(document, "nodes")
    children = {child for node in nodes for child in indices(node, "children")}
    return [index for index in range(len(nodes)) if index not in children] or list(range(len(nodes)))


def _local_matrix(node: Json) -> Float[ndarray, "4 4"]:
    """Transformation of a node's frame to its parent's."""
    if "matrix" in node:
        matrix = np.array(numbers(node, "matrix", IDENTITY)).reshape(4, 4).T
        if matrix[3].tolist() != [0, 0, 0, 1]:
            raise ValueError("the matrix of a node is not affine")
        return matrix
    translation = np.array(numbers(node, "translation", (0.0, 0.0, 0.0)))
    rotation = np.array(numbers(node, "rotation", (0.0, 0.0, 0.0, 1.0)))
    return _compose(translation, rotation, np.array(numbers(node, "scale", (1.0, 1.0, 1.0))))


def _compose(
    translation: Float[ndarray, "3"], rotation: Float[ndarray, "4"], scale: Float[ndarray, "3"]
) -> Float[ndarray, "4 4"]:
    """Matrix that scales, then rotates by a quaternion (x, y, z, w), then translates."""
    length = float(np.linalg.norm(rotation))
    if not 0 < length < math.inf:
        raise ValueError("a rotation is no quaternion")
    x, y, z, w = rotation / length
    turned = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    matrix = np.eye(4)
    matrix[:3, :3] = np.array(turned) * scale
    matrix[:3, 3] = translation
    return matrix


def _instance_matrices(file: Container, node: Json) -> list[Float[ndarray, "4 4"]]:
    """Transformations of a node's instances; one identity for a node that places its mesh once."""
    attributes = nested(node, "extensions", INSTANCES, "attributes")
    wanted = {
        "TRANSLATION": ("VEC3", (0.0, 0, 0)),
        "ROTATION": ("VEC4", (0.0, 0, 0, 1)),
        "SCALE": ("VEC3", (1.0, 1, 1)),
    }
    given = {
        key: np.asarray(read_accessor(file, attributes[key], (kind,)), dtype=np.float64)
        for key, (kind, _) in wanted.items()
        if key in attributes
    }
    if not given:
        return [np.eye(4)]
    counts = {len(each) for each in given.values()}
    if len(counts) != 1:
        raise ValueError(f"the attributes of {INSTANCES} differ in length")
    columns = [given.get(key, np.tile(default, (min(counts), 1))) for key, (_, default) in wanted.items()]
    return [_compose(*each) for each in zip(*columns, strict=True)]


def _written_frame(document: Json) -> Frame | None:
    """File frame that this program wrote into the file; None where it did not."""
    written = nested(document, "asset", "extras", "jointsdf")
    name, metres, known = written.get("unit"), written.get("metres"), written.get("known")
    is_name = isinstance(name, str) and re.fullmatch(r"[!-~]{1,24}", name)
    is_length = isinstance(metres, int | float) and not isinstance(metres, bool) and 0 < metres < math.inf
    if not is_name or not is_length or not isinstance(known, bool):
        return None
    return Frame(Unit(name, float(metres), known), "y" if written.get("up") == "y" else "z")  # type: ignore[arg-type]
