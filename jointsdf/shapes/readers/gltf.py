"""Reader of glTF files: GLB, and gltf with its buffers within it or beside it."""

import io
from pathlib import Path

import numpy as np
import trimesh

from jointsdf.errors import InputError
from jointsdf.shapes.readers.file_mesh import FileMesh


def read_gltf(path: Path, data: bytes) -> FileMesh:
    """Read a glTF file: its meshes in their places, joined.

    Args:
        path: Names the file in messages; buffers of a gltf file lie in its folder.
        data: The file's content.

    Raises:
        InputError: It cannot be read.
    """
    kind = "gltf" if data.lstrip().startswith(b"{") else "glb"
    try:
        beside = trimesh.resolvers.FilePathResolver(str(path))  # refuses what lies outside the folder
        scene = trimesh.load_scene(io.BytesIO(data), file_type=kind, resolver=beside, process=False)
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
    return FileMesh(np.concatenate(vertices), np.concatenate(faces))
