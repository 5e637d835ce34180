"""Pictures with the sides of triangles, pixel by pixel."""

import numpy as np
import trimesh
from labelled_meshes import EMPTY
from solids import labelled

from jointsdf.viewing.palette import part_colours
from jointsdf.viewing.raycast import Camera, viewing_axes
from jointsdf.viewing.triangles import draw_triangles


def camera(wide: float, azimuth: float = 0.0, elevation: float = 0.0) -> Camera:
    return Camera(viewing_axes(azimuth, elevation), np.zeros(3), wide / 100, 100, 80)


def test_lines_are_where_the_sides_are_and_nowhere_else() -> None:
    cube = labelled(trimesh.creation.box((2, 2, 2)))  # each side two triangles, with a diagonal
    picture = draw_triangles(cube, camera(4.0)).astype(float)
    seen = picture[16:64, 26:74]
    assert (picture[:14] == 255).all()
    assert (picture[:, :24] == 255).all()
    plain = np.median(seen, axis=(0, 1))
    dark = seen.sum(axis=2) < 0.85 * plain.sum()
    rows, columns = np.nonzero(dark[2:-2, 2:-2])
    falling, rising = np.abs(rows - columns), np.abs(rows + columns - 43)
    assert min(falling.max(), rising.max()) <= 1, "the diagonal alone is dark inside"
    assert len(rows) >= 44
    for border in (picture[15, 26:74], picture[64, 26:74], picture[16:64, 25], picture[16:64, 74]):
        assert (border.sum(axis=1) < 0.95 * plain.sum()).all()
    hue = part_colours(np.array([0]))[0].astype(float)
    np.testing.assert_allclose(plain / plain.sum(), hue / hue.sum(), atol=0.01)


def test_each_face_has_one_shade() -> None:
    """A coarse ball, whose faces smooth normals would shade unevenly: a few colours fill most of the picture."""
    ball = labelled(trimesh.creation.icosphere(1))
    picture = draw_triangles(ball, camera(0.9, 20.0, 10.0))
    counts = np.unique(picture.reshape(-1, 3), axis=0, return_counts=True)[1]
    assert np.sort(counts)[-8:].sum() > 0.7 * counts.sum()


def test_an_empty_mesh_is_said_to_be_empty() -> None:
    picture = draw_triangles(EMPTY, camera(1.0))
    assert picture.shape == (80, 100, 3)
    assert 0 < (picture < 100).all(axis=2).mean() < 0.1
