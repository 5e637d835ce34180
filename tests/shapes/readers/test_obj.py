"""OBJ files with polygons."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from mesh_files import load, put

from jointsdf.shapes.readers.obj import read_obj

L_SHAPE = ((0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3))  # area 5, outline 12


def prism(first: int) -> str:
    """A prism of height 1 on the L, its two ends polygons that begin at a given corner."""
    lines = [f"v {x} {y} {z}" for z in (0, 1) for x, y in L_SHAPE]
    ring = np.roll(np.arange(6), -first) + 1
    faces = [ring[::-1], ring + 6, *([i + 1, (i + 1) % 6 + 1, (i + 1) % 6 + 7, i + 7] for i in range(6))]
    return "\n".join(lines + ["f " + " ".join(map(str, face)) for face in faces]) + "\n"


@pytest.mark.parametrize("first", range(6))
def test_a_concave_end_is_cut_within_itself(tmp_path: Path, first: int) -> None:
    shape = load(put(tmp_path, "a.obj", prism(first)))
    mesh = trimesh.Trimesh(shape.mesh.vertices, shape.mesh.faces, process=False)
    assert (mesh.area, mesh.volume) == pytest.approx((22, 5))
    assert shape.watertight


def test_triangles_know_their_polygon() -> None:
    mesh = read_obj(Path("a.obj"), prism(0).encode())
    assert mesh.polygons is not None
    assert mesh.polygons.tolist() == [0] * 4 + [1] * 4 + np.repeat(np.arange(2, 8), 2).tolist()
