"""Labels that somebody gave: in the mesh file, beside it, in another file."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from mesh_files import AXES, BOX, COLOURS, SIDES, exported, load, painted, put
from scipy.spatial import KDTree

from jointsdf.errors import InputError
from jointsdf.values import LabelledMesh
from jointsdf.viewing.export import write_mesh
from jointsdf.viewing.part_mesh import PartMesh

IDS = np.array([7, -1, 300, 2**31 - 1, 0, 5])[SIDES]
SHUFFLED = np.random.default_rng(0).permutation(12)


def assert_same_labels(ours: LabelledMesh, theirs: LabelledMesh) -> None:
    """The faces of both are at the same places, with the same labels."""
    centres, others = (mesh.vertices[mesh.faces].mean(axis=1) for mesh in (ours, theirs))
    away, index = KDTree(others).query(centres)
    assert away.max() < 1e-6 * np.ptp(others)
    assert sorted(index) == list(range(len(theirs.faces)))
    np.testing.assert_array_equal(ours.labels, theirs.labels[index])


@pytest.mark.parametrize("name", ["mesh.ply", "mesh.glb"])
@pytest.mark.parametrize("labels", ["auto", "mesh.ply", "mesh.glb", "labels.npy"])
def test_what_the_program_writes_comes_back(
    tmp_path: Path, name: str, labels: str, caplog: pytest.LogCaptureFixture
) -> None:
    mesh = LabelledMesh(np.array(BOX.vertices), np.array(BOX.faces), IDS)
    write_mesh(tmp_path, mesh)
    given = labels if labels == "auto" else str(tmp_path / labels)
    if (name, labels) == ("mesh.glb", "labels.npy"):  # its faces are sorted by part
        with pytest.raises(InputError, match=r"follows the faces of mesh\.ply"):
            load(tmp_path / name, labels=given)
        return
    shape = load(tmp_path / name, labels=given)
    assert_same_labels(shape.mesh, mesh)
    assert shape.label_provider == f"file:{name if labels == 'auto' else labels}"
    assert "passed over" not in caplog.text
    assert "differ" not in caplog.text


@pytest.mark.parametrize("suffix", ["ply", "glb"])
def test_an_exported_part_mesh_comes_back(tmp_path: Path, suffix: str) -> None:
    shape = load("part_07")
    mesh = PartMesh(shape.mesh.vertices, shape.mesh.faces, shape.mesh.labels * 3 + 30)
    again = load(mesh.export(tmp_path / f"a.{suffix}"))
    assert_same_labels(again.mesh, mesh)


def test_own_labels_come_before_those_beside_the_file(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = put(tmp_path, "a.ply", painted(values=IDS))
    np.save(tmp_path / "labels.npy", IDS)
    shape = load(path)
    assert (shape.label_provider, shape.mesh.labels.tolist()) == ("file:a.ply", IDS.tolist())
    assert not caplog.records
    np.save(tmp_path / "labels.npy", SIDES)
    assert load(path).mesh.labels.tolist() == IDS.tolist()
    assert f"its own labels are taken, which differ from those in {tmp_path / 'labels.npy'}" in caplog.text
    caplog.clear()
    assert load(path, labels=str(tmp_path / "labels.npy")).mesh.labels.tolist() == SIDES.tolist()
    path.write_text(painted(values=np.full(12, -1)))
    assert load(path).label_provider == "file:labels.npy", "a file without a labelled face has none"
    with pytest.raises(InputError, match=r"num_parts=3: .*; leave num_parts out"):
        load(put(tmp_path, "a.ply", painted(values=IDS)), num_parts=3)


def test_own_labels_in_another_order_are_suspected(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path, given = put(tmp_path, "a.ply", painted(values=IDS)), tmp_path / "mine.npy"
    for labels, is_suspected in ((IDS, False), (SIDES, False), (IDS[SHUFFLED], True)):
        np.save(given, labels)
        caplog.clear()
        assert load(path, labels=str(given)).mesh.labels.tolist() == labels.tolist()
        assert ("which suggests another order of faces" in caplog.text) == is_suspected


def test_own_labels_that_are_none_are_refused_by_value(tmp_path: Path) -> None:
    for values, found in ((SIDES + 0.5, "holds "), (SIDES - 2, "holds -2"), (SIDES + 2.0**31, "holds 21474836")):
        path = put(tmp_path, "a.ply", painted(values=values).replace("property int label", "property double label"))
        with pytest.raises(InputError, match=rf"a\.ply: its face property label {found}.*labels=geometric leaves it"):
            load(path)
        assert load(path, labels="geometric").label_provider == "geometric:k=6"


def test_colours_and_names_are_suggested_and_taken_by_falling_area(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = put(tmp_path, "a.ply", painted("colour", COLOURS))
    assert load(path).label_provider == "geometric:k=6"
    assert f"{path}: has 3 colours: labels={path}:colour takes them as parts" in caplog.text
    caplog.clear()
    taken = load(path, labels=f"{path}:colour")
    assert (taken.label_provider, taken.mesh.labels.tolist()) == ("file:a.ply:colour", AXES.tolist())
    assert load(path, labels=str(path)).mesh.labels.tolist() == AXES.tolist()
    for labels in ("geometric", "none"):
        load(path, labels=labels)
    assert not caplog.records


def test_any_property_of_a_ply_by_its_name(tmp_path: Path) -> None:
    path = put(tmp_path, "a.ply", painted("quality", IDS))
    assert load(path, labels=f"{path}:quality").mesh.labels.tolist() == IDS.tolist()
    with pytest.raises(InputError, match=r"no column 'area' of its faces: .* quality \(6 values\)"):
        load(path, labels=f"{path}:area")
    np.save(tmp_path / "mine.npy", IDS)
    with pytest.raises(InputError, match=r"only mesh and STEP files have columns; give labels=.*mine\.npy"):
        load(path, labels=f"{tmp_path / 'mine.npy'}:area")
    with pytest.raises(InputError, match=r"labels file not found: .*absent\.ply:quality"):
        load(path, labels=str(tmp_path / "absent.ply:quality"))


def test_labels_of_another_mesh_file_follow_the_place_of_its_faces(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path, other = put(tmp_path, "a.stl", exported("stl")), put(tmp_path, "b.ply", painted(values=IDS))
    assert load(path, labels=str(other)).mesh.labels.tolist() == IDS.tolist()
    assert "another order" not in caplog.text
    other.write_text(painted(values=IDS, order=SHUFFLED))
    shape = load(path, labels=str(other))
    assert (shape.label_provider, shape.mesh.labels.tolist()) == ("file:b.ply", IDS.tolist())
    assert "its faces are in another order" in caplog.text


def test_labels_per_vertex_by_majority(tmp_path: Path) -> None:
    path = put(tmp_path, "a.ply", exported("ply"))
    top = BOX.vertices[:, 2] > 7
    np.save(tmp_path / "labels.npy", top)
    assert load(path).mesh.labels.tolist() == (top[BOX.faces].sum(axis=1) >= 2).astype(int).tolist()


BAD_PLY_LABELS: dict[str, tuple[bytes | str, str]] = {
    "no colours": (exported("ply"), "has no part labels: neither a column label of its faces, nor colours"),
    "fractions": (painted(values=SIDES + 0.5), "its column label holds "),
    "below -1": (painted(values=SIDES - 2), "its column label holds -2"),
    "two faces fewer": (
        painted().replace("element face 12", "element face 10").rsplit("\n", 3)[0] + "\n",
        "has 10 faces, the mesh has 12: it is of another mesh",
    ),
    "another mesh": (painted().replace("6.0", "7.5"), "is of another mesh: of its 12 faces and the mesh's 12"),
    "cut": (painted()[:-30], "truncated"),
}


@pytest.mark.parametrize("case", BAD_PLY_LABELS)
def test_bad_labels_in_a_ply_are_one_line_that_names_it(tmp_path: Path, case: str) -> None:
    content, message = BAD_PLY_LABELS[case]
    path, given = put(tmp_path, "a.ply", exported("ply")), put(tmp_path, "b.ply", content)
    with pytest.raises(InputError) as caught:
        load(path, labels=str(given))
    assert message in str(caught.value)
    assert str(given) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_face_colours_of_another_binary_file(tmp_path: Path) -> None:
    coloured = trimesh.Trimesh(BOX.vertices, BOX.faces[::-1], process=False, face_colors=COLOURS[::-1])
    given = put(tmp_path, "b.ply", coloured.export(file_type="ply"))
    assert load(put(tmp_path, "a.ply", exported("ply")), labels=str(given)).mesh.labels.tolist() == AXES.tolist()
