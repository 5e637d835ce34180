"""PartField's output, found, read and clustered."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from partfield_output import BAR, BY_AREA, ORDER, SECTION, TREE_IDS, in_partfields_frame, load, write_output

from jointsdf import shapes
from jointsdf.errors import InputError
from jointsdf.shapes.labels import partfield
from jointsdf.shapes.readers.mesh_file import read_mesh


@pytest.mark.parametrize("count", [2, 3, 4])
def test_clusters_of_either_kind_in_another_order_are_number_by_area(
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


def test_arrays_without_their_mesh_are_taken_in_the_files_order(bar: Path, tmp_path: Path) -> None:
    (tmp_path / "cluster_out").mkdir()
    np.save(tmp_path / "cluster_out" / "bar_0_04.npy", TREE_IDS[SECTION])
    np.testing.assert_array_equal(load(bar, tmp_path).mesh.labels, BY_AREA)


def test_arrays_without_their_mesh_are_refused_for_polygons(tmp_path: Path) -> None:
    faces = "f 1 2 4 3\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4\n"
    box = "".join(f"v {x} {y} {z}\n" for x in (0, 1) for y in (0, 2) for z in (0, 3)) + faces
    path = tmp_path / "bar.obj"
    path.write_text(box)
    (tmp_path / "cluster_out").mkdir()
    np.save(tmp_path / "cluster_out" / "bar_0_02.npy", np.arange(12) % 2)
    with pytest.raises(InputError, match=r"has no input_bar_0\.ply, .*: the mesh has polygons; triangulate it"):
        load(path, tmp_path)
    triangles = read_mesh(path)
    trimesh.Trimesh(triangles.vertices, triangles.faces, process=False).export(tmp_path / "input_bar_0.ply")
    assert load(path, tmp_path).label_provider == "partfield:k=2"


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
        clusters = {2: tmp_path / name / "cluster_out" / f"{name}_0_02.npy"}
        assert partfield.find_output(tmp_path, [name]).clusters == clusters
