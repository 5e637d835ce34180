"""Pictures pixel by pixel against what is known of the scene; files read back by trimesh; the palette's distances."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image
from skimage.color import rgb2lab

from jointsdf.values import LabelledMesh
from jointsdf.viewing.export import TENSORBOARD_VERTICES, tensorboard_mesh, write_mesh
from jointsdf.viewing.palette import COLOURS, UNLABELLED_COLOUR, part_colours
from jointsdf.viewing.raycast import cast, frame
from jointsdf.viewing.render import compare, render, write_png

EMPTY = LabelledMesh(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64), np.zeros(0, dtype=np.int64))


def box(part: Callable[[np.ndarray], np.ndarray], size: float = 1.0) -> LabelledMesh:
    """A cube whose faces are labelled from their normals."""
    mesh = trimesh.creation.box(extents=[size] * 3)
    return LabelledMesh(np.array(mesh.vertices), np.array(mesh.faces), part(np.array(mesh.face_normals)))


def by_side(normals: np.ndarray) -> np.ndarray:
    return (10 * np.argmax(np.abs(normals), axis=1) + (normals.sum(axis=1) > 0)).astype(np.int64)


def sphere(radius: float, subdivisions: int = 4) -> LabelledMesh:
    mesh = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)
    labels = (np.array(mesh.triangles_center)[:, 2] > 0).astype(np.int64)
    return LabelledMesh(np.array(mesh.vertices), np.array(mesh.faces), labels)


def test_palette_colours_differ_for_normal_and_colour_blind_sight() -> None:
    assert len(COLOURS) >= 20
    colours = np.vstack([COLOURS, UNLABELLED_COLOUR, [255, 255, 255]]) / 255
    linear = np.where(colours <= 0.04045, colours / 12.92, ((colours + 0.055) / 1.055) ** 2.4)
    # Machado, Oliveira, Fernandes 2009, severity 1: normal, deuteranopia, protanopia.
    sights = [
        (np.eye(3), 20),
        ([[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]], 9),
        ([[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]], 9),
    ]
    for matrix, least in sights:
        seen = np.clip(linear @ np.array(matrix).T, 0, 1)
        seen = np.where(seen <= 0.0031308, seen * 12.92, 1.055 * seen ** (1 / 2.4) - 0.055)
        lab = rgb2lab(seen[None])[0]
        distances = np.linalg.norm(lab[:, None] - lab[None], axis=2)[np.triu_indices(len(lab), k=1)]
        assert np.delete(distances, -1).min() > least  # the last: unlabelled against white


def test_colours_are_of_the_id_alone_and_repeat_shifted() -> None:
    labels = np.array([3, -1, 0, 3, 27, 51, 75])
    colours = part_colours(labels)
    assert colours.dtype == np.uint8
    np.testing.assert_array_equal(colours[1], UNLABELLED_COLOUR)
    np.testing.assert_array_equal(colours[0], colours[3])
    np.testing.assert_array_equal(colours[:1], part_colours(labels[:1]))
    assert len(np.unique(part_colours(np.arange(5 * len(COLOURS))), axis=0)) == 5 * len(COLOURS)


def test_rays_see_the_front_of_a_sphere() -> None:
    mesh = sphere(2.0)
    camera = frame(mesh, 200, 100, azimuth=30.0, elevation=20.0)
    hits = cast(mesh, camera)
    row, column = np.nonzero(hits.seen)
    x, y = column + 0.5 - 100, 50 - row - 0.5
    radius = 2.0 / camera.pixel
    assert radius == pytest.approx(50 / 1.06, rel=0.01)
    assert hits.seen.sum() == pytest.approx(np.pi * radius**2, rel=0.01)
    inner = np.hypot(x, y) < 0.9 * radius
    depth = -np.sqrt(radius**2 - x[inner] ** 2 - y[inner] ** 2)
    np.testing.assert_allclose(hits.depths[row, column][inner], depth, atol=0.01 * radius)
    normals = np.stack([x[inner], y[inner], depth], axis=1) / radius
    np.testing.assert_allclose(hits.normals[row, column][inner], normals, atol=0.02)


def test_each_side_of_a_cube_shows_its_own_colour() -> None:
    mesh = box(by_side)
    for azimuth, label in [(0.0, 1), (90.0, 11), (180.0, 0), (270.0, 10)]:
        middle = render(mesh, width=64, height=64, azimuth=azimuth, elevation=0.0)[32, 32].astype(float)
        hue, expected = middle / middle.sum(), part_colours(np.array([label]))[0].astype(float)
        np.testing.assert_allclose(hue, expected / expected.sum(), atol=0.02)
    top = render(mesh, width=64, height=64, azimuth=0.0, elevation=60.0)
    visible = cast(mesh, frame(mesh, 64, 64, azimuth=0.0, elevation=60.0))
    assert set(mesh.labels[np.unique(visible.faces[visible.seen])].tolist()) == {1, 21}
    assert (top[0, 0] == 255).all()


def test_right_is_right_and_up_is_up() -> None:
    mesh = sphere(1.0)
    camera = frame(mesh, 64, 64, azimuth=0.0, elevation=0.0)
    projected = camera.project(np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]))
    np.testing.assert_allclose(projected * camera.pixel, [[1, 0, 0], [0, 1, 0], [0, 0, -1]], atol=1e-9)


def test_lines_lie_on_part_borders_creases_and_the_outline() -> None:
    ball = sphere(1.0)
    picture = render(ball, width=200, height=200, azimuth=0.0, elevation=0.0).astype(int).sum(axis=2)
    column = picture[:, 100]
    assert column[98:103].min() < 300  # the border between the halves, through the middle
    radius = round(100 / 1.06)
    assert column[100 - radius - 2 : 100 - radius + 3].min() < 300  # the outline
    assert column[20:95].min() > 300
    one_part = box(lambda normals: np.zeros(len(normals), dtype=np.int64))
    cube = render(one_part, width=200, height=200, azimuth=45.0, elevation=0.0).astype(int).sum(axis=2)
    flat = np.median(cube[100, 60:90])
    assert cube[100, 98:103].min() < 0.85 * flat
    assert np.ptp(cube[100, 45:90]) <= 3


def test_picture_is_the_same_each_time_and_in_other_units() -> None:
    mesh = box(by_side)
    first = render(mesh, width=80, height=60)
    np.testing.assert_array_equal(first, render(mesh, width=80, height=60))
    moved = LabelledMesh(mesh.vertices * 1000 + [5e4, -2e4, 7e3], mesh.faces, mesh.labels)
    other = render(moved, width=80, height=60)
    assert (np.abs(first.astype(int) - other).max(axis=2) > 8).mean() < 0.01


def test_comparison_keeps_the_scale_of_the_ground_truth() -> None:
    truth, half = box(by_side), box(by_side, size=0.5)
    picture = compare(truth, half, width=120, height=90)
    assert picture.shape == (90 + 24, 240, 3)
    left, right = (picture[:90, :120] < 250).any(axis=2), (picture[:90, 120:] < 250).any(axis=2)
    assert right.sum() / left.sum() == pytest.approx(0.25, abs=0.03)
    np.testing.assert_array_equal(picture[:90, :120], render(truth, width=120, height=90))
    assert (picture[90:, :120] < 100).any()
    assert (picture[90:, 120:] < 100).any()


def test_an_empty_prediction_says_so() -> None:
    blank = render(EMPTY, width=120, height=90)
    assert blank.shape == (90, 120, 3)
    assert 0 < (blank < 128).any(axis=2).mean() < 0.2
    assert (blank[:20] == 255).all()
    np.testing.assert_array_equal(compare(box(by_side), EMPTY, width=120, height=90)[:90, 120:], blank)
    assert compare(EMPTY, box(by_side), width=120, height=90).shape == (114, 240, 3)


def test_png_round_trip(tmp_path: Path) -> None:
    picture = render(box(by_side), width=40, height=30)
    write_png(tmp_path / "a.png", picture)
    np.testing.assert_array_equal(np.array(Image.open(tmp_path / "a.png")), picture)
    assert [path.name for path in tmp_path.iterdir()] == ["a.png"]


def test_ply_and_labels_round_trip_exactly(tmp_path: Path) -> None:
    ball = sphere(1.0, subdivisions=3)
    labels = np.random.default_rng(0).integers(-1, 90, len(ball.faces))
    mesh = LabelledMesh(ball.vertices / 3 + [1e5, 2e5, 3e5], ball.faces, labels)
    write_mesh(tmp_path / "run", mesh)
    assert sorted(path.name for path in (tmp_path / "run").iterdir()) == ["labels.npy", "mesh.glb", "mesh.ply"]
    read = trimesh.load_mesh(tmp_path / "run" / "mesh.ply", process=False)
    np.testing.assert_array_equal(read.vertices, mesh.vertices)
    np.testing.assert_array_equal(read.faces, mesh.faces)
    np.testing.assert_array_equal(read.visual.face_colors[:, :3], part_colours(labels))
    np.testing.assert_array_equal(read.metadata["_ply_raw"]["face"]["data"]["label"].reshape(-1), labels)
    stored = np.load(tmp_path / "run" / "labels.npy", allow_pickle=False)
    assert stored.dtype == np.int64
    np.testing.assert_array_equal(stored, labels)


def test_glb_has_one_coloured_node_per_part(tmp_path: Path) -> None:
    mesh = box(lambda normals: by_side(normals) - 1)
    write_mesh(tmp_path, mesh)
    scene = trimesh.load_scene(tmp_path / "mesh.glb")
    names = {"unlabelled" if part < 0 else f"part_{part}": part for part in np.unique(mesh.labels)}
    assert set(scene.graph.nodes_geometry) == set(names)
    for name, part in names.items():
        geometry = scene.geometry[name]
        triangles = mesh.vertices[mesh.faces[mesh.labels == part]]
        np.testing.assert_allclose(geometry.triangles, triangles, atol=1e-6)
        linear = np.array(geometry.visual.material.baseColorFactor[:3]) / 255
        srgb = np.where(linear <= 0.0031308, linear * 12.92, 1.055 * linear ** (1 / 2.4) - 0.055)
        np.testing.assert_allclose(srgb * 255, part_colours(np.array([part]))[0], atol=6)


def test_empty_mesh_writes_a_valid_ply_and_labels(tmp_path: Path) -> None:
    write_mesh(tmp_path, box(by_side))
    write_mesh(tmp_path, EMPTY)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["labels.npy", "mesh.ply"]
    content = (tmp_path / "mesh.ply").read_bytes()
    assert content.endswith(b"end_header\n")
    assert b"element vertex 0\n" in content
    assert b"element face 0\n" in content
    assert np.load(tmp_path / "labels.npy").shape == (0,)


def test_tensorboard_faces_keep_their_colour_and_place() -> None:
    mesh = LabelledMesh(box(by_side).vertices * [30, 10, 20] + 500, box(by_side).faces, box(by_side).labels)
    vertices, colours, faces = tensorboard_mesh(mesh)
    assert vertices.shape == colours.shape == (1, 24, 3)  # 6 sides, 4 corners each
    assert faces.shape == (1, 12, 3)
    for corner in range(3):
        np.testing.assert_array_equal(colours[0][faces[0, :, corner]], part_colours(mesh.labels))
    np.testing.assert_allclose(vertices[0].min(axis=0), [-1, -1 / 3, -2 / 3], atol=1e-6)
    np.testing.assert_allclose(vertices[0][faces[0]] * 15 + 500, mesh.vertices[mesh.faces], atol=1e-4)


def test_tensorboard_refuses_what_it_would_corrupt() -> None:
    count = TENSORBOARD_VERTICES // 3 + 1
    vertices = np.random.default_rng(0).normal(size=(3 * count, 3))
    faces = np.arange(3 * count).reshape(-1, 3)
    fits = LabelledMesh(vertices, faces[:-1], np.zeros(count - 1, dtype=np.int64))
    assert tensorboard_mesh(fits)[0].shape == (1, TENSORBOARD_VERTICES, 3)
    with pytest.raises(ValueError, match="65538 vertices: TensorBoard shows at most 65535"):
        tensorboard_mesh(LabelledMesh(vertices, faces, np.zeros(count, dtype=np.int64)))
