import logging
import os
from pathlib import Path

import numpy as np
import pytest
import trimesh
from mesh_files import load, put

from jointsdf.errors import InputError
from jointsdf.shapes.readers import mesh_file
from jointsdf.shapes.readers.abc_features import find_features_file, read_features

ABC = Path(os.environ.get("JOINTSDF_ABC", "absent"))
RAW = ABC.parent / "abc_raw"
ID = "00000007_0123456789abcdef01234567"
OBJ = (
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvn 0 0 1\n"
    "f 1//1 3//1 2//1\nf 1//1 2//1 4//1\nf 2//1 3//1 4//1\nf 1//1 4//1 3//1\n"
)
CURVES = """curves:
- {sharp: true, type: Line, vert_indices: [0, 1]}
- sharp: true
  type: BSpline
  poles:
  - [0.5, -1.0e-3]
  vert_indices: [2, 1,
    0, 2, 2]
- {sharp: false, type: Circle, vert_indices: [0, 3]}
"""
SURFACES = """surfaces:
- {face_indices: [0, 3], type: Plane, vert_indices: [0, 1, 2]}
- face_indices: [1,
    2]
  type: BSpline
  poles:
  - - [0.0, 1.0, 2.0]
"""
YML = CURVES + SURFACES


def test_patches_surfaces_and_sharp_edges(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    found = read_features(put(tmp_path, "a.yml", YML), 4, 4)
    assert found.patches.tolist() == [0, 1, 1, 0]
    assert found.surfaces == ("plane", "bspline")
    assert found.sharp_edges.tolist() == [[0, 1], [0, 2], [1, 2]]
    assert not caplog.records


def test_faces_of_no_patch_are_unlabelled_and_counted(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    found = read_features(put(tmp_path, "a.yml", YML.replace("[0, 3], type", "[0], type")), 5, 4)
    assert found.patches.tolist() == [0, 1, 1, -1, -1]
    assert "2 of 5 faces are in no patch" in caplog.text
    empty = read_features(put(tmp_path, "b.yml", "curves: []\nsurfaces: []\n"), 3, 3)
    assert (empty.patches.tolist(), empty.surfaces, empty.sharp_edges.shape) == ([-1] * 3, (), (0, 2))


def test_curves_with_vertices_that_were_not_found_lose_those_edges_only(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    found = read_features(put(tmp_path, "a.yml", YML.replace("vert_indices: [2, 1,", "vert_indices: [2, -1,")), 4, 4)
    assert found.patches.tolist() == [0, 1, 1, 0]
    assert found.sharp_edges.tolist() == [[0, 1], [0, 2]], "0 to 1 is of the other curve"
    assert "1 curves have vertices -1, which no mesh has: left out" in caplog.text


LAUGHS = "a: &a [0]\n" + "".join(
    f"{b}: &{b} [{','.join(['*' + a] * 9)}]\n" for a, b in zip("abcdefgh", "bcdefghi", strict=True)
)
BAD_FILES: dict[str, tuple[str | bytes, str]] = {
    "zero bytes": ("", "is empty"),
    "blank": ("\n\n", "is empty"),
    "noise": (bytes(range(256)), "truncated or damaged"),
    "words": ("hello\n", "no ABC features file"),
    "a list": ("- 1\n- 2\n", "no ABC features file"),
    "other yml": ("name: Bracket\n", "no ABC features file, or truncated: it has no list of surfaces"),
    "cut before the surfaces": (CURVES, "truncated: it has no list of surfaces"),
    "cut in a list": (YML[: YML.index("2]\n  type: BSpline\n  poles:\n  - - ")], "truncated or damaged"),
    "cut in a patch": (YML[: YML.rindex("  type: BSpline")], r"truncated or damaged: surfaces\[1\] has no type"),
    "curves missing": (SURFACES, "no list of curves"),
    "a curve without vertices": (YML.replace("vert_indices: [0, 3]", "x: 1"), r"curves\[2\] has no vert_indices"),
    "a patch that is no mapping": (CURVES + "surfaces: [1]\n", r"surfaces\[0\] has no face_indices"),
    "a list as a key": (YML + "? [1]\n: 2\n", "truncated or damaged"),
    "face beyond the mesh": (YML.replace("[0, 3], type", "[0, 4], type"), r"names face 4, the mesh has 0\.\.3"),
    "vertex beyond the mesh": (YML.replace("2, 2]", "2, 9]"), r"names vertex 9, the mesh has 0\.\.3"),
    "endless face": (YML.replace("[0, 3], type", f"[{'9' * 5000}], type"), "names face 99999999999999999999,"),
    "negative face": (YML.replace("[0, 3], type", "[-1], type"), "face indices are not a list of integers"),
    "vertex below -1": (YML.replace("2, 2]", "2, -2]"), "vertex indices are not a list of integers"),
    "fraction of a face": (YML.replace("[0, 3], type", "[0.5], type"), "face indices are not a list of integers"),
    "a list of lists": (YML.replace("[0, 3], type", "[[0], 3], type"), "face indices are not a list of integers"),
    "one index": (YML.replace("[0, 3], type", "3, type"), "face indices are not a list of integers"),
    "face in two patches": (YML.replace("[0, 3], type", "[0, 1], type"), "more than one patch"),
    "face twice in a patch": (YML.replace("[0, 3], type", "[0, 0], type"), "more than one patch"),
    "object tag": (YML + "x: !!python/object/apply:os.system ['touch HIT']\n", "tags or references"),
    "standard tag": (YML.replace("[0, 3], type", "[!!int '0'], type"), "tags or references"),
    "references that multiply": (LAUGHS, "tags or references"),
    "merge keys": ("x: &x {a: 1}\ny: {<<: *x}\n" + YML, "tags or references"),
    "deep brackets": ("[" * 200_000, "nested deeper than 20"),
    "deep braces": ("{a: " * 200_000, "nested deeper than 20"),
    "deep dashes": ("- " * 200_000, "nested deeper than 20"),
}  # fmt: skip


@pytest.mark.parametrize(("content", "message"), BAD_FILES.values(), ids=BAD_FILES)
def test_bad_files_are_one_line(
    tmp_path: Path, content: str | bytes, message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=message) as caught:
        read_features(put(tmp_path, "a.yml", content), 4, 4)
    assert "\n" not in str(caught.value)
    assert "a.yml" in str(caught.value)
    assert len(str(caught.value)) < 300
    assert [path.name for path in tmp_path.iterdir()] == ["a.yml"]


def test_the_features_file_beside_an_abc_obj(tmp_path: Path) -> None:
    mesh = tmp_path / f"{ID}_trimesh_003.obj"
    assert find_features_file(mesh) is None
    put(tmp_path, "00000008_0123456789abcdef01234567_features_003.yml", "")
    assert find_features_file(mesh) is None
    other = put(tmp_path, f"{ID}_features_000.yml", "")
    assert find_features_file(mesh) == other
    same = put(tmp_path, f"{ID}_features_003.yml", "")
    assert find_features_file(mesh) == same
    for name in (f"{ID}_trimesh_003.stl", "bracket.obj", f"x{ID}_trimesh_003.obj"):
        assert find_features_file(tmp_path / name) is None


def test_which_labels_an_abc_obj_gets(tmp_path: Path) -> None:
    mesh = put(tmp_path, f"{ID}_trimesh_003.obj", OBJ)
    assert load(mesh).label_provider.startswith("geometric:")
    assert load(mesh, labels="brep").label_provider == "none"
    with pytest.raises(InputError, match=r"labels=brep: .*patches.npy not found"):
        load(mesh, labels="brep", segmented=True)
    np.save(tmp_path / "patches.npy", np.arange(4))
    put(tmp_path, f"{ID}_features_003.yml", YML)
    shape = load(mesh, labels="brep", segmented=True)
    assert (shape.label_provider, shape.mesh.labels.tolist()) == ("brep", [0, 1, 1, 0])
    atoms = load(mesh, num_parts=2, segmented=True)
    assert (atoms.label_provider, atoms.mesh.labels.tolist()) == ("geometric:k=2", [1, 0, 0, 1])
    assert set(load(mesh, labels="none").mesh.labels) == {-1}
    np.save(tmp_path / "labels.npy", np.array([5, 5, 6, 6]))
    assert load(mesh).mesh.labels.tolist() == [5, 5, 6, 6]
    assert load(mesh, labels="brep").mesh.labels.tolist() == [0, 1, 1, 0]


def test_a_features_file_given_by_hand(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.WARNING)
    mesh, given = put(tmp_path, "part.obj", OBJ + "f 1 1 2\n"), put(tmp_path, "mine.yml", YML)
    shape = load(mesh, labels=str(given))
    assert (shape.label_provider, shape.mesh.labels.tolist()) == ("file:mine.yml", [0, 1, 1, 0])
    assert "1 of 5 faces are in no patch" in caplog.text
    with pytest.raises(InputError, match=r"labels file not found: .*other.yml"):
        load(mesh, labels=str(tmp_path / "other.yml"))


@pytest.mark.skipif(not RAW.is_dir(), reason="no abc_raw beside the folder that JOINTSDF_ABC names")
@pytest.mark.parametrize(("model", "name"), [("00000655", "abc_0015"), ("00004807", "abc_0033")])
def test_abc_as_it_is_distributed(model: str, name: str) -> None:
    path = next(RAW.glob(f"{model}_*_trimesh_*.obj"))
    shape = load(path, labels="brep", segmented=True)
    assert (shape.label_provider, shape.watertight) == ("brep", True)
    known = trimesh.load(ABC / name / "mesh.ply", process=False)
    assert trimesh.Trimesh(shape.mesh.vertices, shape.mesh.faces, process=False).volume == pytest.approx(
        known.volume, rel=1e-6
    )
    patches = np.load(ABC / name / "patches.npy")
    here, there = shape.mesh.vertices[shape.mesh.faces].mean(axis=1), known.triangles_center
    np.testing.assert_allclose(here, there, atol=1e-5 * known.extents.max())
    pairs = np.unique(np.stack([shape.mesh.labels, patches]), axis=1)
    assert pairs.shape[1] == len(np.unique(patches)) == len(np.unique(shape.mesh.labels))


@pytest.mark.skipif(not RAW.is_dir(), reason="no abc_raw beside the folder that JOINTSDF_ABC names")
def test_surfaces_and_sharp_edges_of_a_real_model() -> None:
    path = next(RAW.glob("00000655_*_trimesh_*.obj"))
    mesh = mesh_file.read_mesh(path)
    found = read_features(next(RAW.glob("00000655_*_features_*.yml")), len(mesh.faces), len(mesh.vertices))
    assert found.surfaces == ("cone", "sphere", "plane", "cylinder")
    sphere = mesh.vertices[mesh.faces[found.patches == 1]].reshape(-1, 3)
    fit = np.linalg.lstsq(np.column_stack([2 * sphere, np.ones(len(sphere))]), (sphere**2).sum(axis=1), rcond=None)[0]
    radii = np.linalg.norm(sphere - fit[:3], axis=1)
    np.testing.assert_allclose(radii, radii.mean(), rtol=3e-4)
    sides = np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    owners: dict[tuple[int, ...], set[int]] = {}
    for edge, patch in zip(map(tuple, sides.tolist()), np.repeat(found.patches, 3).tolist(), strict=True):
        owners.setdefault(edge, set()).add(patch)
    assert len(found.sharp_edges) > 50
    assert all(len(owners[tuple(edge)]) == 2 for edge in found.sharp_edges.tolist())
