"""PartField's output is imitated: its files' names, shapes, ids and frame, with faces in another order."""

import logging
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
from sklearn.metrics import adjusted_rand_score

from jointsdf import shapes
from jointsdf.errors import InputError
from jointsdf.shapes.labels import partfield
from jointsdf.shapes.labels.__main__ import main
from jointsdf.shapes.labels.face_matching import match_faces
from jointsdf.values import Shape

BAR = trimesh.creation.box((12, 2, 2), transform=trimesh.transformations.translation_matrix((30, 4, 1))).subdivide()
BAR = BAR.subdivide().subdivide()
SECTION = np.digitize(BAR.triangles_center[:, 0], [25.5, 31.5, 33.0])  # lengths 1.5, 6, 1.5 and 3; two have a cap
BY_AREA = np.array([2, 0, 3, 1])[SECTION]
ORDER = np.random.default_rng(3).permutation(len(BAR.faces))
TREE_IDS = np.array([5000, 17, 812, 30])


def in_partfields_frame(mesh: trimesh.Trimesh, order: np.ndarray) -> trimesh.Trimesh:
    vertices = np.random.default_rng(1).permutation(len(mesh.vertices))
    back = np.argsort(vertices)
    low, high = mesh.bounds
    placed = (mesh.vertices - (low + high) / 2) * (1.8 / (high - low).max())
    return trimesh.Trimesh(placed[vertices].astype(np.float32), back[mesh.faces[order]], process=False)


def write_output(
    folder: Path, name: str, *, mesh: bool = True, features: bool = True, counts: tuple[int, ...] = ()
) -> None:
    (folder / "cluster_out").mkdir(parents=True, exist_ok=True)
    if mesh:
        in_partfields_frame(BAR, ORDER).export(folder / f"input_{name}_0.ply")
    if features:
        noise = np.random.default_rng(2).normal(0, 0.02, (len(ORDER), 16))
        vectors = (np.eye(16)[SECTION] + noise) * np.random.default_rng(4).uniform(0.1, 9, (len(ORDER), 1))
        np.save(folder / f"part_feat_{name}_0_batch.npy", vectors[ORDER].astype(np.float32))
    for count in counts:
        ids = TREE_IDS[np.minimum(SECTION, count - 1)][ORDER]
        as_kmeans = count % 2 == 0
        stored = ids.astype(np.float32)[:, None] if as_kmeans else ids
        np.save(folder / "cluster_out" / f"{name}_0_{count:02d}.npy", stored)


@pytest.fixture
def bar(tmp_path: Path) -> Path:
    path = tmp_path / "bar.v2.ply"
    BAR.export(path)
    return path


def load(path: Path, folder: Path | None, **options: object) -> Shape:
    return shapes.load(str(path), labels="partfield", partfield_dir=folder, abc_root="nowhere", **options)


@pytest.mark.parametrize("count", [2, 3, 4])
def test_clusters_of_either_kind_in_another_order_are_numbered_by_area(
    bar: Path, tmp_path: Path, count: int, caplog: pytest.LogCaptureFixture
) -> None:
    write_output(tmp_path / "out", "bar", counts=(1, 2, 3, 4), features=False)
    shape = load(bar, tmp_path / "out", num_parts=count)
    assert shape.label_provider == f"partfield:k={count}"
    expected = {2: [1, 0, 0, 0], 3: [2, 0, 1, 1], 4: [2, 0, 3, 1]}[count]
    np.testing.assert_array_equal(shape.mesh.labels, np.array(expected)[SECTION])
    assert "in another order" in caplog.text


def test_without_a_wish_the_most_parts_up_to_18_are_taken(bar: Path, tmp_path: Path) -> None:
    write_output(tmp_path / "out", "bar", counts=(1, 2, 3, 20))
    assert load(bar, tmp_path / "out").label_provider == "partfield:k=3"
    for path in (tmp_path / "out" / "cluster_out").iterdir():
        path.unlink()
    shape = load(bar, tmp_path / "out")
    assert (shape.label_provider, len(shape.mesh.part_ids)) == ("partfield:k=18", 18)


def test_features_are_cut_at_any_number_of_parts(bar: Path, tmp_path: Path) -> None:
    write_output(tmp_path / "out", "bar", counts=(2,))
    shape = load(bar, tmp_path / "out", num_parts=4)
    assert shape.label_provider == "partfield:k=4"
    np.testing.assert_array_equal(shape.mesh.labels, BY_AREA)
    for count in (3, 7, 40):
        assert load(bar, tmp_path / "out", num_parts=count).mesh.part_ids.tolist() == list(range(count))


def test_parts_of_a_cut_are_connected_and_bodies_apart_can_share_one() -> None:
    bodies = [
        trimesh.creation.box(transform=trimesh.transformations.translation_matrix((3 * i, 0, 0))) for i in range(5)
    ]
    corners = np.concatenate([body.subdivide().triangles for body in bodies])
    kind = np.repeat([0, 0, 1, 0, 0], len(corners) // 5)
    features = np.eye(4)[kind] + np.random.default_rng(0).normal(0, 0.01, (len(corners), 4))
    parts = partfield.cut(features, corners, 3)
    assert adjusted_rand_score(parts, np.repeat([0, 0, 1, 2, 2], len(corners) // 5)) == 1.0


def test_a_single_piece_with_two_patches_of_like_features_is_not_one_part() -> None:
    features = np.eye(3)[np.isin(SECTION, (0, 3)).astype(int)]  # both ends alike, the middle differs
    parts = partfield.cut(features, BAR.triangles, 3)
    assert adjusted_rand_score(parts, np.digitize(SECTION, [1, 3])) == 1.0


def test_arrays_without_their_mesh_are_taken_in_the_files_order(bar: Path, tmp_path: Path) -> None:
    (tmp_path / "cluster_out").mkdir()
    np.save(tmp_path / "cluster_out" / "bar_0_04.npy", TREE_IDS[SECTION])
    np.testing.assert_array_equal(load(bar, tmp_path).mesh.labels, BY_AREA)


def test_a_built_in_part_is_known_by_its_name(tmp_path: Path) -> None:
    mesh = shapes.load("part_03", abc_root="nowhere").mesh
    (tmp_path / "cluster_out").mkdir()
    np.save(tmp_path / "cluster_out" / "part_03_0_02.npy", np.arange(len(mesh.faces)) % 2)
    shape = shapes.load("part_03", labels="partfield", partfield_dir=tmp_path, abc_root="nowhere")
    assert (shape.label_provider, shape.mesh.part_ids.tolist()) == ("partfield:k=2", [0, 1])


def damage(folder: Path, case: str) -> None:
    cluster = folder / "cluster_out" / "bar_0_04.npy"
    if case == "cut":
        cluster.write_bytes(cluster.read_bytes()[:-9])
    elif case == "fractions":
        np.save(cluster, np.full((len(SECTION), 1), 0.5))
    elif case == "other length":
        np.save(cluster, np.arange(5))
    elif case == "other mesh":
        trimesh.creation.box().export(folder / "input_bar_0.ply")
    elif case == "moved":
        moved = in_partfields_frame(BAR, ORDER)
        moved.vertices[7] += 0.2
        moved.export(folder / "input_bar_0.ply")


DAMAGES = {
    "cut": "truncated",
    "fractions": "holds no integers",
    "other length": r"has shape \(5,\), the mesh has 768 faces",
    "other mesh": "has 12 faces, the mesh has 768",
    "moved": "of another mesh",
}


@pytest.mark.parametrize("case", DAMAGES)
def test_damaged_output_is_one_line(bar: Path, tmp_path: Path, case: str) -> None:
    write_output(tmp_path / "out", "bar", counts=(4,))
    damage(tmp_path / "out", case)
    with pytest.raises(InputError, match=DAMAGES[case]) as caught:
        load(bar, tmp_path / "out")
    assert "\n" not in str(caught.value)


def test_damaged_features_are_one_line(bar: Path, tmp_path: Path) -> None:
    write_output(tmp_path, "bar")
    path = tmp_path / "part_feat_bar_0_batch.npy"
    for array, message in (
        (np.zeros((5, 4)), "has shape"),
        (np.full((len(SECTION), 4), np.nan), "finite"),
        (np.zeros((len(SECTION), 4), dtype=int), "holds no features"),
    ):
        np.save(path, array)
        with pytest.raises(InputError, match=message):
            load(bar, tmp_path)


def test_absent_partfield_says_how_to_get_it(bar: Path, tmp_path: Path) -> None:
    for folder, message in (
        (None, "needs PartField's output"),
        (tmp_path / "no", "is no folder"),
        (tmp_path, "nothing for"),
    ):
        with pytest.raises(InputError, match=message) as caught:
            load(bar, folder)
        assert "github.com/nv-tlabs/PartField" in str(caught.value)
        assert "\n" not in str(caught.value)


def test_too_many_parts_or_no_way_to_them(bar: Path, tmp_path: Path) -> None:
    write_output(tmp_path, "bar", counts=(2, 4), features=False)
    with pytest.raises(InputError, match=r"num_parts=3: .* only 2, 4 parts"):
        load(bar, tmp_path, num_parts=3)
    write_output(tmp_path, "bar")
    with pytest.raises(InputError, match="num_parts=1000000: the mesh has 768 faces"):
        load(bar, tmp_path, num_parts=10**6)


def test_names_with_special_letters_find_their_own_files_only(tmp_path: Path) -> None:
    for name in ("a", "a_0", "[a]"):
        write_output(tmp_path / name, name, counts=(2,), features=False)
        assert partfield.find(tmp_path, [name]).clusters == {2: tmp_path / name / "cluster_out" / f"{name}_0_02.npy"}


def test_matching_finds_permuted_faces_and_turned_corners() -> None:
    turned = np.roll(BAR.triangles[ORDER], 1, axis=1) * 0.3 - 7
    np.testing.assert_array_equal(match_faces("it", turned, BAR.triangles), np.argsort(ORDER))
    flipped = BAR.triangles[ORDER][:, ::-1]
    np.testing.assert_array_equal(match_faces("it", flipped, BAR.triangles), np.argsort(ORDER))
    rounded = BAR.triangles[ORDER].round(5)
    np.testing.assert_array_equal(match_faces("it", rounded, BAR.triangles), np.argsort(ORDER))


def test_matching_tells_faces_that_touch_by_their_normals(caplog: pytest.LogCaptureFixture) -> None:
    other = trimesh.creation.box(transform=trimesh.transformations.translation_matrix((1, 0, 0)))
    corners = np.concatenate([trimesh.creation.box().triangles, other.triangles])
    order = np.random.default_rng(0).permutation(24)
    np.testing.assert_array_equal(match_faces("it", corners[order], corners), np.argsort(order))
    assert "matched by their centres" in caplog.text
    caplog.clear()
    np.testing.assert_array_equal(match_faces("it", corners, corners), np.arange(24))
    assert not caplog.records


# Two scripts with the command lines and files of PartField's; arguments are written down for the test.
INFERENCE = """
import sys
from pathlib import Path
import numpy as np, trimesh
words = sys.argv[1:]
assert words[:2] == ["-c", "configs/final/demo.yaml"] and words[2] == "--opts", words
options = dict(zip(words[3::2], words[4::2]))
assert Path(options["continue_ckpt"]).read_text() == "weights"
out = Path("exp_results", options["result_name"]); out.mkdir(parents=True)
for path in Path(options["dataset.data_path"]).glob("*.obj"):
    mesh = trimesh.load(path, process=False)
    order = np.random.default_rng(0).permutation(len(mesh.faces))
    low, high = mesh.bounds
    placed = (mesh.vertices - (low + high) / 2) * (1.8 / (high - low).max())
    name = path.name.split(".")[0]
    trimesh.Trimesh(placed, mesh.faces[order], process=False).export(out / f"input_{name}_0.ply")
    np.save(out / f"part_feat_{name}_0.npy", np.eye(8)[np.digitize(mesh.triangles_center[order, 0], [25.5, 31.5, 33])])
"""
CLUSTERING = """
import argparse
from pathlib import Path
import numpy as np, trimesh
parser = argparse.ArgumentParser()
for name in ("root", "dump_dir", "source_dir", "use_agglo", "max_num_clusters", "option"):
    parser.add_argument("--" + name, required=True)
given = parser.parse_args()
assert (given.use_agglo, given.max_num_clusters, given.option) == ("True", "20", "0")
assert list(Path(given.source_dir).glob("*.obj"))
out = Path(given.dump_dir)
for kind in ("cluster_out", "ply"):
    (out / kind).mkdir()
for path in Path(given.root).glob("part_feat_*.npy"):
    uid, view = path.stem.split("_")[-2:]
    section = np.load(path).argmax(axis=1)
    mesh = trimesh.load(Path(given.root) / f"input_{uid}_{view}.ply", process=False)
    for count in (1, 2, 3, 4):
        parts = np.minimum(section, count - 1)
        np.save(out / "cluster_out" / f"{uid}_{view}_{count:02d}.npy", np.array([900, 33, 12, 601])[parts])
        mesh.visual.face_colors = np.array([[255, 0, 0], [0, 255, 0], [0, 0, 255], [9, 9, 9]], dtype=np.uint8)[parts]
        mesh.export(out / "ply" / f"{uid}_{view}_{count:02d}.ply")
"""


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    folder = tmp_path / "PartField"
    folder.mkdir()
    (folder / "partfield_inference.py").write_text(INFERENCE)
    (folder / "run_part_clustering.py").write_text(CLUSTERING)
    (folder / "model.ckpt").write_text("weights")
    return folder


def command(bar: Path, checkout: Path, *more: str) -> int:
    return main(["partfield", "--repo", str(checkout), "--checkpoint", str(checkout / "model.ckpt"), str(bar), *more])


def test_a_checkout_is_called_and_its_parts_imported(
    bar: Path, checkout: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    assert command(bar, checkout) == 0
    labels, painted = tmp_path / "bar.v2_partfield_04.npy", tmp_path / "bar.v2_partfield_04.ply"
    np.testing.assert_array_equal(np.load(labels), BY_AREA)
    for given in (labels, painted):
        shape = shapes.load(str(bar), labels=str(given), abc_root="nowhere")
        assert shape.label_provider == f"file:{given.name}"
        np.testing.assert_array_equal(shape.mesh.labels, BY_AREA)
    assert f"labels={labels}" in caplog.text
    shape = load(bar, checkout / "exp_results", num_parts=2)
    np.testing.assert_array_equal(shape.mesh.labels, (SECTION == 0).astype(int))
    assert len(load(bar, checkout / "exp_results", num_parts=6).mesh.part_ids) == 6, "from its features"
    assert command(bar, checkout, "--num-parts", "2") == 0
    np.testing.assert_array_equal(np.load(tmp_path / "bar.v2_partfield_02.npy"), (SECTION == 0).astype(int))


@pytest.mark.parametrize("case", ["no checkout", "no weights", "fails", "no mesh", "no python"])
def test_a_failing_checkout_is_one_line(bar: Path, checkout: Path, case: str, caplog: pytest.LogCaptureFixture) -> None:
    more: tuple[str, ...] = ()
    if case == "no checkout":
        (checkout / "run_part_clustering.py").unlink()
    elif case == "no weights":
        (checkout / "model.ckpt").unlink()
    elif case == "fails":
        (checkout / "partfield_inference.py").write_text("raise RuntimeError('no NVIDIA driver')")
    elif case == "no mesh":
        bar.unlink()
    else:
        more = ("--python", "/no/such/python")
    assert command(bar, checkout, *more) == 2
    message = caplog.records[-1].getMessage()
    expected = {
        "no checkout": "no run_part_clustering.py",
        "no weights": "download model_objaverse.ckpt",
        "fails": "no NVIDIA driver",
        "no mesh": "file not found",
        "no python": "/no/such/python",
    }
    assert expected[case] in message
    assert "\n" not in message
    assert not list(bar.parent.glob("*partfield_*"))


def test_the_command_line_is_a_module() -> None:
    done = subprocess.run(
        [sys.executable, "-W", "error::RuntimeWarning", "-m", "jointsdf.shapes.labels", "partfield", "--help"],
        capture_output=True, text=True, check=True, cwd=Path(__file__).parents[3],
    )  # fmt: skip
    assert "--checkpoint" in done.stdout
