"""Files of the ABC dataset for one catalogue shape, a box, and 7z archives of them."""

import os
from pathlib import Path

import numpy as np
import py7zr
import pytest
import trimesh

from jointsdf.abc_dataset import prepare
from jointsdf.shapes import abc

ABC = Path(os.environ.get("JOINTSDF_ABC", "absent"))
RAW = ABC.parent / "abc_raw"
NEEDS_RAW = pytest.mark.skipif(not RAW.is_dir(), reason="no abc_raw beside the folder that JOINTSDF_ABC names")
NAME = "abc_0003"
MODEL = "00000007_b33a147f86da49879455d286"
OBJ, YML = f"{MODEL}_trimesh_000.obj", f"{MODEL}_features_000.yml"


def box(sides: tuple[float, ...], corner: tuple[float, ...] = (0.0, 0.0, 0.0)) -> trimesh.Trimesh:
    return trimesh.creation.box(bounds=[corner, np.add(corner, sides)])


def obj_text(*boxes: trimesh.Trimesh) -> bytes:
    mesh = trimesh.util.concatenate(boxes)
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in mesh.vertices]
    return "\n".join(lines + [f"f {a} {b} {c}" for a, b, c in mesh.faces + 1]).encode()


def sides_of(mesh: trimesh.Trimesh) -> np.ndarray:
    """Of a box, the side that each face is on."""
    normals = np.round(np.array(mesh.face_normals)).astype(int)
    return np.unique(normals, axis=0, return_inverse=True)[1].reshape(-1)


def yml_text(patches: np.ndarray) -> bytes:
    surfaces = [
        f"- face_indices: [{', '.join(map(str, np.flatnonzero(patches == each)))}]\n  type: Plane\n"
        for each in np.unique(patches)
    ]
    return ("curves: []\nsurfaces:\n" + "".join(surfaces)).encode()


MESH = box(tuple(side / 1000 for side in abc.catalogue()[NAME].extents), (0.1, -0.2, 0.3))  # metres
PATCHES = sides_of(MESH)
FILES = {OBJ: obj_text(MESH), YML: yml_text(PATCHES)}


def seven_zip(path: Path, files: dict[str, bytes], *, blocks: bool = False) -> Path:
    """A 7z file, its members together or each in a block of its own."""
    for number, (name, data) in enumerate(files.items()):
        with py7zr.SevenZipFile(path, "a" if number else "w") as opened:
            if blocks:
                opened.writestr(data, name)
                continue
            for each, content in files.items():
                opened.writestr(content, each)
            break
    return path


def filled(folder: Path, files: dict[str, bytes] | None = None) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    for name, data in (FILES if files is None else files).items():
        (folder / name).write_bytes(data)
    return folder


def assert_box_is_prepared(root: Path) -> None:
    mesh = trimesh.load(root / NAME / "mesh.ply", process=False)
    assert np.allclose(mesh.vertices, MESH.vertices * 1000, atol=1e-4)
    assert (mesh.faces == MESH.faces).all()
    patches = np.load(root / NAME / "patches.npy")
    assert patches.dtype == np.int32
    assert (patches == PATCHES).all()


def outcomes(
    root: Path, *sources: Path, names: tuple[str, ...] = (NAME,), **options: str
) -> dict[str, tuple[str, str]]:
    found = prepare.prepare(names, root, sources, **options)
    return {each.name: (each.status, each.detail) for each in found}
