"""A cloud as the shape of a run, by the command that a user types: its row, its pictures, its scores measured again."""

import math
from pathlib import Path

import numpy as np
import pytest
import trimesh
from cloud_files import as_text, on_box, written
from command_line import assert_one_line_error, call, train
from PIL import Image
from solids import halves

import jointsdf
from jointsdf.errors import InputError
from jointsdf.runs.row import ResultRow, read_row
from jointsdf.shapes.clouds.sources import load_cloud
from jointsdf.study.collect import collect
from jointsdf.study.tables.write import write_tables
from jointsdf.viewing.slice import write_slice

pytestmark = pytest.mark.filterwarnings("default")
BOX = on_box(1500)
FIT = ("data.distances=cloud", "trainer.preview_every=2")


@pytest.fixture
def scan(tmp_path: Path) -> Path:
    return written(tmp_path, "scan.xyzc", as_text(BOX))


@pytest.fixture
def truth(tmp_path: Path) -> Path:
    mesh = halves()
    trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(tmp_path / "part.stl")
    np.save(tmp_path / "part.labels.npy", mesh.labels)
    return tmp_path / "part.stl"


def row_in(outputs: Path) -> tuple[ResultRow, Path]:
    (path,) = outputs.rglob("result.json")
    return read_row(path), path.parent


def test_without_a_truth_held_out_points_score(tmp_path: Path, scan: Path) -> None:
    answer = train(tmp_path / "out", *FIT, f"shape={scan}", "data.corruption.noise=0.001")
    assert answer.code == 0, answer.text
    row, folder = row_in(tmp_path / "out")
    assert row.scores.keys() == {"holdout"}
    assert (row.provenance["truth"], row.provenance["corruption"]) == ("holdout", "noise=0.001")
    assert row.provenance["label_provider"] == "file:scan.xyzc:label"
    assert (row.num_parts, row.counts["points_gt"], "faces_gt" in row.counts) == (2, 1500, False)
    assert math.isfinite(row.scores["holdout"]["held_out_mean"]) or row.status == "empty_mesh"
    for words in ("1500 points, longest side 4", "scan-", "noise  ", "1350 points are thinned to 1000 at random"):
        assert words in answer.text
    assert "held-out points" in answer.lines[-2] or "empty_mesh" in answer.text
    with Image.open(folder / "preview.png") as picture:
        assert picture.width > picture.height, "points beside the fit, without a slice"
    again = call("evaluate.py", f"run={folder}")
    assert "every score as stored" in again.text, again.text
    with pytest.raises(InputError, match="is a point cloud without a mesh to compare with; fit it with truth="):
        write_slice(folder, tmp_path / "slice.png")
    written_tables = {path.name for path in write_tables([row], tmp_path / "out", tmp_path / "none")}
    assert {"held_out.csv", "held_out.tex", "cost.csv"} <= written_tables
    assert not {"main_reconstruction.csv", "worst.csv"} & written_tables
    assert collect([row])["protocol"].tolist() == ["holdout"]


def test_with_a_truth_a_cloud_scores_as_a_mesh_does(tmp_path: Path, scan: Path, truth: Path) -> None:
    answer = train(tmp_path / "out", *FIT, f"shape={scan}", f"truth={truth}")
    assert answer.code == 0, answer.text
    row, folder = row_in(tmp_path / "out")
    assert row.scores.keys() == {"unit", "flatcad"}
    assert row.provenance["truth"] == load_cloud(scan, truth=truth).truth.name
    assert row.counts["faces_gt"] == len(halves().faces)
    assert "1500 points are thinned to 1000" in answer.text, "none is held out"
    assert "every score as stored" in call("evaluate.py", f"run={folder}").text
    truth.unlink()
    assert_one_line_error(call("evaluate.py", f"run={folder}"), "part.stl")


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        (["recipe=fast"], ["data.distances=mesh", "is a point cloud", "recipe=points"]),
        ([], ["data.distances=mesh", "is a point cloud", "recipe=points"]),
        (["data.distances=cloud", "labels=geometric"], ["labels=geometric cuts meshes"]),
        (["data.distances=cloud", "labels=zone"], ["no column or label file 'zone'", "label"]),
        (["data.distances=cloud", "truth=part_01"], ["truth=part_01", "of the longest side away"]),
        (["data.distances=cloud", "truth=gone.stl"], ["gone.stl"]),
        (["data.distances=cloud", "data.corruption.scanner.views=3"], ["scanner.views=3", "the shape is a cloud"]),
        (["data.distances=cloud", "data.part_points=9"], ["data.part_points=9", "is a cloud"]),
    ],
    ids=str,
)
def test_a_mistake_is_one_line(tmp_path: Path, scan: Path, overrides: list[str], words: list[str]) -> None:
    assert_one_line_error(train(tmp_path / "out", f"shape={scan}", *overrides), *words)
    assert not list(tmp_path.rglob("result.json"))


def test_arrays_are_fitted_by_the_library() -> None:
    cloud = load_cloud(points=BOX.points, labels=BOX.labels, name="mine")
    small = ["trainer.max_steps=2", "trainer.preview_every=0", "extraction.resolution=16", "data.pool_size=300"]
    small += [f"data.counts.{name}=40" for name in ("manifold", "non_manifold", "shell", "pool")]
    small += ["data.distances=cloud"]
    fitted = jointsdf.fit(cloud, recipe="smoke", overrides=small, quiet=True)
    assert fitted.row.shape == "mine"
    assert fitted.scores == fitted.row.scores["holdout"]
    assert fitted.field.query(BOX.points[:5], what="sdf").sdf.shape == (5,)
