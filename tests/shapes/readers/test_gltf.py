"""glTF files that are text."""

import base64
import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from mesh_files import BOX, load, put

from jointsdf.errors import InputError


def gltf_files() -> dict[str, bytes]:
    return dict(trimesh.Scene({"box": BOX}).export(file_type="gltf"))


@pytest.mark.parametrize("embedded", [False, True])
def test_buffers_beside_the_file_and_within_it(tmp_path: Path, embedded: bool) -> None:
    files = gltf_files()
    document = json.loads(files.pop("model.gltf"))
    for buffer in document["buffers"]:
        if embedded:
            data = base64.b64encode(files[buffer["uri"]]).decode()
            buffer["uri"] = f"data:application/octet-stream;base64,{data}"
        else:
            put(tmp_path, buffer["uri"], files[buffer["uri"]])
    mesh = load(put(tmp_path, "part.gltf", json.dumps(document))).mesh
    np.testing.assert_allclose(mesh.vertices[mesh.faces], BOX.triangles, atol=1e-6)


def test_a_buffer_outside_the_folder_is_not_read(tmp_path: Path) -> None:
    files = gltf_files()
    document = json.loads(files["model.gltf"])
    for buffer in document["buffers"]:
        put(tmp_path, buffer["uri"], files[buffer["uri"]])
        buffer["uri"] = f"../{buffer['uri']}"
    (tmp_path / "inner").mkdir()
    path = put(tmp_path, "inner/part.gltf", json.dumps(document))
    with pytest.raises(InputError, match="cannot be read as gltf"):
        load(path)
