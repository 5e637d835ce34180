"""Close-ups of a cube's field, and the command."""

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from analytic import box_distance
from command_line import finished
from labelled_meshes import EMPTY, sphere
from PIL import Image
from run_folders import own_copy, row_of
from solids import labelled

from jointsdf.errors import InputError
from jointsdf.extraction.extractor import Extraction
from jointsdf.model.field import JointField
from jointsdf.values import UNMOVED, LabelledMesh, Shape
from jointsdf.viewing.closeup import CAPTION, GAP, HEIGHT, WIDTH, both_ways, close_up, main, parse_place

BOX = labelled(trimesh.creation.box((1, 1, 1)))


class Cube(JointField):
    """The distance to `BOX`, in place of a fitted field."""

    def __init__(self) -> None:
        super().__init__({"width": 8, "depth": 2, "tap": 1}, {"name": "none"}, np.arange(0), UNMOVED)

    def network_sdf(self, points: np.ndarray) -> np.ndarray:
        return box_distance(points, [0.5, 0.5, 0.5])

    def network_differential(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        values, step = self.network_sdf(points), 1e-3
        slopes = [
            (self.network_sdf(points + by) - self.network_sdf(points - by)) / (2 * step) for by in step * np.eye(3)
        ]
        return values, np.stack(slopes, axis=1)


def shape_of(mesh: LabelledMesh) -> Shape:
    return Shape("solid", mesh, "sha", "builtin", watertight=True)


def test_the_sharp_mesh_is_nearer_to_the_picture_of_the_truth() -> None:
    plain, sharp = both_ways(Cube(), Extraction(resolution=40))
    corner = np.array([0.5, 0.5, 0.5])
    assert np.linalg.norm(sharp.vertices - corner, axis=1).min() < 1e-3
    assert np.linalg.norm(plain.vertices - corner, axis=1).min() > 1e-2
    picture = close_up(shape_of(BOX), {"a": plain, "b": sharp, "c": BOX}, 1.5, corner).astype(int)
    assert picture.shape == (HEIGHT + CAPTION, 3 * WIDTH + 2 * GAP, 3)
    first, second, third = (picture[:HEIGHT, k * (WIDTH + GAP) :][:, :WIDTH] for k in range(3))
    outside = [(each == 255).all(axis=2) for each in (first, second, third)]
    assert (outside[0] != outside[2]).sum() > 2000  # pixels along the outline
    assert (outside[1] != outside[2]).sum() < 20


def test_the_same_place_is_in_all_pictures_and_empty_meshes_are_said_to_be_so() -> None:
    picture = close_up(shape_of(BOX), {"a": BOX, "b": BOX, "c": EMPTY}, 0.4)
    first, second, third = (picture[:HEIGHT, k * (WIDTH + GAP) :][:, :WIDTH] for k in range(3))
    np.testing.assert_array_equal(first, second)
    assert (first < 250).mean() > 0.3 > 0.1 > (third < 100).mean() > 0


def test_a_ball_needs_a_place() -> None:
    ball = shape_of(sphere(1.0))
    with pytest.raises(InputError, match=r"no crease .*--at"):
        close_up(ball, {"a": ball.mesh}, 0.1)
    assert (close_up(ball, {"a": ball.mesh}, 0.5, np.array([1.0, 0, 0])) < 250).mean() > 0.3


@pytest.mark.parametrize("at", ["1,2", "1,2,3,4", "a,b,c", "nan,0,0", ""])
def test_an_odd_place_is_named_in_one_line(at: str) -> None:
    with pytest.raises(InputError, match=f"--at {at}: give x, y and z"):
        parse_place(at)


def test_the_command_draws_a_finished_run(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    to = tmp_path / "closeup.png"
    assert main([str(finished()), str(to), "--at", "1,0,2"]) == 0
    with Image.open(to) as picture:
        assert picture.size == (3 * WIDTH + 2 * GAP, HEIGHT + CAPTION)
        assert len(picture.convert("RGB").getcolors(1000)) <= 64
    first = to.read_bytes()
    assert main([str(finished()), str(to)]) == 0
    assert to.read_bytes() != first
    assert main([str(tmp_path), str(tmp_path / "none.png")]) == 2
    assert str(tmp_path) in caplog.text
    assert not (tmp_path / "none.png").exists()


@pytest.mark.parametrize("grid", [None, "16", True])
def test_a_row_without_its_grid_is_one_line(tmp_path: Path, caplog: pytest.LogCaptureFixture, grid: object) -> None:
    folder = own_copy(tmp_path)
    row = row_of(folder)
    row["provenance"]["resolution"] = grid
    (folder / "result.json").write_text(json.dumps(row))
    assert main([str(folder), str(tmp_path / "none.png")]) == 2
    assert f"{folder / 'result.json'}: no provenance.resolution" in caplog.text
    assert "Traceback" not in caplog.text
