import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation
from sklearn.metrics import adjusted_rand_score
from solids import labelled

from jointsdf.errors import InputError
from jointsdf.geometry.face_graph import face_graph
from jointsdf.geometry.mesh import face_areas
from jointsdf.geometry.topology import components
from jointsdf.shapes import load
from jointsdf.shapes.builtin import BUILTINS, part_names
from jointsdf.shapes.builtin.construction import Construction, box, rod
from jointsdf.shapes.segmentation.hierarchy import Hierarchy, build_hierarchy
from jointsdf.shapes.segmentation.merging import SMALLEST
from jointsdf.values import LabelledMesh

COUNTS = (None, 2, 3, 7, 18, 40)
CREASED = ["part_02", "part_05", "part_06", "part_08", "part_11", "part_12", "part_15", "part_41"]
TURN = Rotation.from_euler("xyz", (0.3, -1.1, 2.0)).as_matrix()


def bare(mesh: LabelledMesh) -> trimesh.Trimesh:
    return trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)


def refined(mesh: LabelledMesh) -> LabelledMesh:
    """Each face as four, one after the other."""
    ends = np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    edges, middle = np.unique(ends, axis=0, return_inverse=True)
    (a, b, c), (ab, bc, ca) = mesh.faces.T, middle.reshape(-1, 3).T + len(mesh.vertices)
    faces = np.stack([a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca], axis=1).reshape(-1, 3)
    return LabelledMesh(
        np.concatenate([mesh.vertices, mesh.vertices[edges].mean(axis=1)]), faces, np.repeat(mesh.labels, 4)
    )


def pieces_of(mesh: LabelledMesh, labels: np.ndarray) -> int:
    """Into how many connected pieces the parts fall, by an independent flood fill."""
    adjacency = trimesh.graph.face_adjacency(mesh.faces)
    inside = adjacency[labels[adjacency[:, 0]] == labels[adjacency[:, 1]]]
    return len(trimesh.graph.connected_components(inside, nodes=np.arange(len(labels)), min_len=1))


def agreement(first: np.ndarray, second: np.ndarray, mesh: LabelledMesh) -> float:
    """Adjusted Rand index of two labellings at 20000 points that are uniform in area."""
    cumulative = np.cumsum(face_areas(mesh))
    faces = np.searchsorted(cumulative, (np.arange(20000) + 0.5) / 20000 * cumulative[-1])
    return float(adjusted_rand_score(first[faces], second[faces]))


def connected_parts(mesh: LabelledMesh) -> np.ndarray:
    """The construction labels, each repeat of a part (one of four holes) for itself."""
    pairs = face_graph(mesh).pairs
    return components(pairs[mesh.labels[pairs[:, 0]] == mesh.labels[pairs[:, 1]]], len(mesh.faces))


def uneven_part() -> LabelledMesh:
    """A part without any symmetry: no two of its regions are alike."""
    part = Construction()
    part.add("plate", box((0, 0, 0), (80, 50, 8)))
    part.add("boss", rod((22, 20, 7), 25, 11))
    part.add("block", box((50, 12, 7), (71, 37, 19)))
    part.cut("hole", rod((41, 40, -1), 10, 4))
    part.cut("bore", rod((22, 20, -1), 40, 5))
    return part.mesh()


@pytest.fixture(scope="module")
def uneven() -> tuple[LabelledMesh, Hierarchy]:
    mesh = uneven_part()
    return mesh, build_hierarchy(mesh, None)


SOLIDS: dict[str, Callable[[], LabelledMesh]] = {
    **{name: BUILTINS[name] for name in ("part_01", "part_02", "part_05", "part_06", "part_21", "part_30")},
    "uneven": uneven_part,
    "ball": lambda: labelled(trimesh.creation.icosphere(3)),
    "ring": lambda: labelled(trimesh.creation.torus(10, 2)),
    "cube": lambda: labelled(trimesh.creation.box().subdivide_loop(0).subdivide().subdivide()),
}


@pytest.mark.parametrize("name", SOLIDS)
def test_parts_are_connected_large_enough_nested_and_numbered_by_area(name: str) -> None:
    mesh = SOLIDS[name]()
    tree = build_hierarchy(mesh, None)
    finer = None
    for count in sorted({tree.natural_parts, *COUNTS[1:]}, reverse=True):
        labels = tree.cut(count)
        areas = np.bincount(labels, face_areas(mesh))
        assert len(areas) == count == pieces_of(mesh, labels)
        assert (np.diff(areas) <= 1e-6 * areas.sum()).all()
        assert areas.min() >= SMALLEST * areas.sum()
        if finer is not None:
            assert len(np.unique(np.stack([finer, labels]), axis=1).T) == finer.max() + 1
        finer = labels
    assert 2 <= tree.natural_parts <= 18


@pytest.mark.parametrize("names", [CREASED, pytest.param(part_names(), marks=pytest.mark.slow)])
def test_parts_are_those_of_the_construction(names: list[str]) -> None:
    found = {}
    for name in names:
        mesh = BUILTINS[name]()
        truth = connected_parts(mesh)
        found[name] = agreement(truth, build_hierarchy(mesh, None).cut(int(truth.max()) + 1), mesh)
    assert np.mean(list(found.values())) > 0.6
    assert min(found[name] for name in CREASED) > 0.9


def test_every_pair_of_construction_parts_comes_apart(uneven: tuple[LabelledMesh, Hierarchy]) -> None:
    mesh, tree = uneven
    without_hole = np.where(mesh.labels == 3, 0, mesh.labels)
    assert adjusted_rand_score(without_hole, tree.cut(4)) == 1.0
    hole, plate = (np.unique(tree.cut(7)[mesh.labels == part]) for part in (3, 0))
    assert len(hole) == 1
    assert hole[0] not in plate


@pytest.mark.parametrize("count", COUNTS)
def test_same_parts_in_any_order_of_faces(uneven: tuple[LabelledMesh, Hierarchy], count: int | None) -> None:
    mesh, tree = uneven
    order = np.random.default_rng(5).permutation(len(mesh.faces))
    rolled = np.stack([np.roll(face, turn) for turn, face in enumerate(mesh.faces[order])])
    shuffled = build_hierarchy(LabelledMesh(mesh.vertices, rolled, mesh.labels[order]), None)
    np.testing.assert_array_equal(shuffled.cut(count), tree.cut(count)[order])
    np.testing.assert_array_equal(build_hierarchy(mesh, None).cut(count), tree.cut(count))


@pytest.mark.parametrize("scale", [1.0, 1e-3, 250.0])
@pytest.mark.parametrize("count", [None, 3, 5, 9])
def test_same_parts_in_any_pose_and_unit(
    uneven: tuple[LabelledMesh, Hierarchy], scale: float, count: int | None
) -> None:
    mesh, tree = uneven
    moved = replace(mesh, vertices=scale * (mesh.vertices @ TURN.T + [70.0, -300.0, 11.0]))
    np.testing.assert_array_equal(build_hierarchy(moved, None).cut(count), tree.cut(count))


@pytest.mark.parametrize("name", ["uneven", "part_01", "part_02", "part_06", "part_30"])
def test_natural_parts_survive_remeshing(name: str) -> None:
    mesh = SOLIDS[name]()
    fine = refined(mesh)
    before, after = build_hierarchy(mesh, None), build_hierarchy(fine, None)
    count = before.natural_parts
    assert abs(after.natural_parts - count) <= 1
    assert agreement(np.repeat(before.cut(count), 4), after.cut(count), fine) > 0.95


def test_smooth_bodies_are_split_into_like_pieces() -> None:
    mesh = SOLIDS["ring"]()
    tree = build_hierarchy(mesh, None)
    for count in (2, 4, 8):
        areas = np.bincount(tree.cut(count), face_areas(mesh))
        assert areas.max() < 1.1 * areas.min()
    assert tree.natural_parts == 2


def test_several_bodies() -> None:
    parts = [
        trimesh.creation.icosphere(2, radius=r).apply_translation((x, 0, 0)) for r, x in ((3, 0), (2, 9), (0.1, 20))
    ]
    mesh = labelled(trimesh.util.concatenate(parts))
    body = np.repeat([0, 1, 2], [len(part.faces) for part in parts])
    tree = build_hierarchy(mesh, None)
    np.testing.assert_array_equal(tree.cut(3), body, err_msg="a whole body is a part, however small")
    np.testing.assert_array_equal(tree.cut(2), [0, 1, 1] @ (body == np.arange(3)[:, None]), err_msg="the nearest joins")
    assert pieces_of(mesh, tree.cut(10)) == 10


def test_open_and_non_manifold_meshes() -> None:
    tube = trimesh.creation.cylinder(1, 6, sections=12)
    side = labelled(tube.submesh([np.abs(tube.face_normals[:, 2]) < 0.5], append=True))
    assert pieces_of(side, build_hierarchy(side, None).cut(4)) == 4
    boxes = [trimesh.creation.box().apply_translation(shift) for shift in ((0, 0, 0), (1, 1, 0))]
    joined = trimesh.util.concatenate(boxes)
    joined.merge_vertices()
    mesh = labelled(joined)
    uses = np.unique(np.sort(joined.edges, axis=1), axis=0, return_counts=True)[1]
    assert 4 in uses, "the boxes share an edge"
    parts = build_hierarchy(mesh, None).cut(2)
    np.testing.assert_array_equal(parts, np.repeat(parts[[0, 12]], 12))
    assert parts[0] != parts[12]


def test_ten_faces() -> None:
    corners = [(np.cos(a), np.sin(a), 0) for a in np.arange(5) * 2 * np.pi / 5]
    vertices = np.array([*corners, (0.1, 0.05, 1.3), (0, 0, -0.7)])
    faces = [(k, (k + 1) % 5, 5) for k in range(5)] + [((k + 1) % 5, k, 6) for k in range(5)]
    mesh = LabelledMesh(vertices, np.array(faces), np.full(10, -1))
    tree = build_hierarchy(mesh, None)
    assert [int(tree.cut(count).max()) + 1 for count in (1, 2, 5, 10)] == [1, 2, 5, 10]
    for count in (0, 11):
        with pytest.raises(InputError, match=f"num_parts={count}: this mesh can be cut into 1 to 10 parts"):
            tree.cut(count)


def test_patches_are_never_mixed_and_their_pieces_are_parts() -> None:
    mesh = SOLIDS["cube"]()
    patches = np.where(mesh.vertices[mesh.faces].mean(axis=1)[:, 0] > 0, 3, 8)
    parts = build_hierarchy(mesh, patches).cut(2)
    assert adjusted_rand_score(parts, patches) == 1.0


def test_slivers_are_absorbed() -> None:
    mesh = SOLIDS["uneven"]()
    noisy = np.arange(len(mesh.faces))
    tree = build_hierarchy(mesh, noisy)
    assert tree.areas.min() >= SMALLEST


def test_saved_hierarchy_is_the_same(tmp_path: Path, uneven: tuple[LabelledMesh, Hierarchy]) -> None:
    _, tree = uneven
    tree.save(tmp_path / "parts.npz")
    loaded = Hierarchy.load(tmp_path / "parts.npz")
    for count in COUNTS:
        np.testing.assert_array_equal(loaded.cut(count), tree.cut(count))


def real(name: str) -> tuple[LabelledMesh, Hierarchy]:
    if "JOINTSDF_ABC" not in os.environ:
        pytest.skip("the environment variable JOINTSDF_ABC does not name a folder of ABC meshes")
    root = Path(os.environ["JOINTSDF_ABC"])
    mesh = load(name, abc_root=root, labels="none", segmented=False).mesh
    patches = root / name / "patches.npy"
    return mesh, build_hierarchy(mesh, np.load(patches) if patches.is_file() else None)


def test_flange_and_shaft_come_apart() -> None:
    mesh, tree = real("abc_0016")
    centre = (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2
    radius = np.linalg.norm((mesh.vertices - centre)[mesh.faces].mean(axis=1)[:, :2], axis=1)
    flange = radius > 0.8 * radius.max()
    parts = tree.cut(3)
    assert len(np.unique(parts[flange])) == 1
    assert (parts[radius < 0.4 * radius.max()] != parts[flange][0]).all()


def test_body_and_two_arms_come_apart() -> None:
    mesh, tree = real("abc_0001")
    along = mesh.vertices[mesh.faces].mean(axis=1)[:, 0]
    along = along - (along.max() + along.min()) / 2
    parts = tree.cut(3)
    ends = [parts[along < -0.95 * along.max()], parts[along > 0.95 * along.max()]]
    body = np.unique(parts[np.abs(along) < 0.3 * along.max()])
    assert [len(np.unique(end)) for end in ends] == [1, 1]
    assert len({int(ends[0][0]), int(ends[1][0]), *body.tolist()}) == 3


def test_hole_walls_are_parts_of_their_own() -> None:
    part = Construction()
    part.add("plate", box((0, 0, 0), (60, 40, 5)))
    part.cut("holes", *(rod((x, y, -1), 7, r) for x, y, r in ((9, 9, 3), (50, 9, 3.4), (9, 30, 3.8), (50, 30, 4.2))))
    mesh = part.mesh()
    parts = build_hierarchy(mesh, None).cut(5)
    assert agreement(connected_parts(mesh), parts, mesh) > 0.99
    assert (build_hierarchy(mesh, None).cut(1) == 0).all()


def test_a_body_too_small_to_measure_stays_whole() -> None:
    speck = trimesh.creation.box().apply_scale(1e-11).apply_translation((5, 0, 0))
    mesh = labelled(trimesh.util.concatenate([trimesh.creation.box(), speck]))
    parts = build_hierarchy(mesh, None).cut(None)
    assert len(np.unique(parts[12:])) == 1
