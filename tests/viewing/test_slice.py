"""Values of a slice against analytic distances, and its command."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch
import trimesh
from analytic import box_distance, sphere_distance
from command_line import finished
from PIL import Image
from solids import labelled

from jointsdf.model.field import JointField
from jointsdf.values import Normalisation, Shape
from jointsdf.viewing.isolines import HEIGHT, WIDTH
from jointsdf.viewing.plane import Plane, choose_plane
from jointsdf.viewing.slice import main, render_slice, slice_field

MIDDLE = np.array([70.0, -20.0, 4.0])
FRAME = Normalisation(MIDDLE + 0.5, 12.0)


def shape_of(solid: trimesh.Trimesh) -> Shape:
    return Shape("solid", labelled(solid.apply_translation(MIDDLE)), "sha", "builtin", watertight=solid.is_watertight)


def field_of(frame: Normalisation = FRAME) -> JointField:
    torch.manual_seed(0)
    return JointField({"width": 8, "depth": 2, "tap": 1}, {"name": "none"}, np.arange(0), frame)


@pytest.mark.parametrize(
    ("solid", "distance", "tolerance"),
    [
        (trimesh.creation.box((20, 10, 6)), lambda points: box_distance(points, (10, 5, 3)), 1e-9),
        (trimesh.creation.icosphere(5, radius=9), lambda points: sphere_distance(points, 9), 0.006),
    ],
)
def test_truth_is_the_exact_distance(
    solid: trimesh.Trimesh, distance: Callable[[np.ndarray], np.ndarray], tolerance: float
) -> None:
    shape = shape_of(solid)
    for plane in (choose_plane(shape.mesh, FRAME), Plane.at(0, 72.0, FRAME)):
        found = slice_field(shape, field_of(), plane, raster=40)
        exact = distance(plane.raster(40) - MIDDLE).reshape(40, 40)
        assert exact.min() < -1
        np.testing.assert_allclose(found.truth, exact, atol=tolerance)
        assert found.size == pytest.approx(np.ptp(solid.vertices, axis=0).max())


def test_fit_is_the_field_at_the_raster() -> None:
    shape, field = shape_of(trimesh.creation.box((20, 10, 6))), field_of()
    plane = choose_plane(shape.mesh, FRAME)
    found = slice_field(shape, field, plane, raster=12)
    columns, rows = plane.ticks(12)
    for row, column in [(0, 0), (3, 8), (11, 5)]:
        point = np.full(3, plane.place)
        point[[plane.right, plane.up]] = columns[column], rows[row]
        assert found.fit[row, column] == pytest.approx(float(field.query(point, what="sdf").sdf), rel=1e-5)


def test_a_mesh_without_inside_is_drawn() -> None:
    sheet = trimesh.creation.box((20, 10, 6))
    sheet.update_faces(sheet.face_normals[:, 2] > 0.5)
    picture = render_slice(shape_of(sheet), field_of(), caption="fit", width=WIDTH // 4, raster=16)
    assert picture.shape == (HEIGHT // 4, WIDTH // 4, 3)
    assert picture.std() > 10


@pytest.mark.parametrize("at", [None, "y=20", " z = 3.5 "])
def test_the_command_draws_a_finished_run(tmp_path: Path, at: str | None) -> None:
    arguments = [str(finished()), str(tmp_path / "slice.png"), *([] if at is None else ["--at", at])]
    assert main(arguments) == 0
    first = (tmp_path / "slice.png").read_bytes()
    with Image.open(tmp_path / "slice.png") as picture:
        assert picture.size == (WIDTH, HEIGHT)
    if at is None:
        assert main(arguments) == 0
        assert (tmp_path / "slice.png").read_bytes() == first


@pytest.mark.parametrize(
    ("folder", "at", "named"),
    [
        (None, "y=400", "--at y=400: outside the training box; give y from -"),
        (None, "w=4", "--at w=4: give an axis and a coordinate"),
        (None, "x=far", "--at x=far: give an axis and a coordinate"),
        (None, "x=nan", "--at x=nan: outside the training box"),
        ("nowhere", "x=4", "nowhere"),
    ],
)
def test_a_mistake_is_one_line(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, folder: str | None, at: str, named: str
) -> None:
    assert main([str(finished() if folder is None else tmp_path / folder), str(tmp_path / "a.png"), "--at", at]) == 2
    (line,) = [record.getMessage() for record in caplog.records if record.levelname == "ERROR"]
    assert named in line
    assert not (tmp_path / "a.png").exists()
