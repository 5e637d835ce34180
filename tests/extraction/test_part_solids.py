"""Solids of parts: closed, outward, and together the whole."""

import numpy as np
import pytest
import trimesh
from analytic import box_distance, sphere_distance
from solids import as_trimesh, halves, labelled, volume

from jointsdf.errors import InputError
from jointsdf.extraction.extractor import Extraction
from jointsdf.extraction.part_solids import field_part_solids, part_solids
from jointsdf.values import UNMOVED, LabelledMesh


def to_halves(points: np.ndarray) -> np.ndarray:
    return box_distance(points - [0.5, 0, 0], (2, 1, 1))


def assert_solids_of(solids: dict[int, LabelledMesh], whole: LabelledMesh) -> None:
    assert list(solids) == whole.part_ids.tolist()
    for part, mesh in solids.items():
        assert as_trimesh(mesh).is_watertight, part
        assert as_trimesh(mesh).is_winding_consistent, part
        assert volume(mesh) > 0, part
        assert set(mesh.labels.tolist()) == {part}
    assert sum(map(volume, solids.values())) == pytest.approx(volume(whole), rel=1e-6)


@pytest.mark.parametrize("far", [0.0, 1e5])
def test_two_halves_of_a_box_are_two_boxes(far: float) -> None:
    whole = LabelledMesh(halves().vertices + far, halves().faces, halves().labels)
    solids = part_solids(whole, lambda points: to_halves(points - far), 48)
    assert_solids_of(solids, whole)
    for part, low, high in ((4, 0.5, 2.5), (9, -1.5, 0.5)):
        assert volume(solids[part]) == pytest.approx(8, rel=2e-3)
        x = solids[part].vertices[:, 0] - far
        assert (x.min(), x.max()) == (pytest.approx(low, abs=4 / 48), pytest.approx(high, abs=4 / 48))


def test_the_cells_of_a_cubes_faces_are_pyramids() -> None:
    """Three parts of two faces each: where three cells meet, no two cutters coincide."""
    cube = trimesh.creation.box((2, 2, 2)).subdivide().subdivide()
    whole = labelled(cube, np.abs(cube.face_normals).argmax(axis=1))
    solids = part_solids(whole, lambda points: box_distance(points, (1, 1, 1)), 40)
    assert_solids_of(solids, whole)
    for part, mesh in solids.items():
        assert volume(mesh) == pytest.approx(8 / 3, rel=0.01)
        inner = mesh.vertices[np.abs(mesh.vertices).max(axis=1) < 0.9]
        others = np.delete(np.abs(inner), part, axis=1).max(axis=1)
        assert (np.abs(np.abs(inner[:, part]) - others) < 2 / 40).all()


def test_caps_of_a_ball_of_another_mesh_and_a_part_in_two_pieces() -> None:
    surface = Extraction(48).labelled_mesh(
        lambda points: sphere_distance(points, 0.8),
        lambda points: np.where(np.abs(points[:, 2]) > 0.4, 7, 2),
        UNMOVED,
    )
    solids = part_solids(surface, lambda points: sphere_distance(points, 0.8), 40)
    assert_solids_of(solids, surface)
    assert volume(solids[7]) / volume(surface) == pytest.approx(0.5, abs=0.02)  # two cones: a share of (1 - z / r)


def test_what_is_no_solid_of_parts_is_one_line(small_field) -> None:
    bare = LabelledMesh(halves().vertices, halves().faces, np.full(len(halves().faces), -1))
    with pytest.raises(InputError, match=r"^solids of parts: the surface has no parts"):
        part_solids(bare, to_halves)
    open_box = LabelledMesh(halves().vertices, halves().faces[1:], halves().labels[1:])
    with pytest.raises(InputError, match=r"^solids of parts: a surface is not closed .*; give another resolution"):
        part_solids(open_box, to_halves, 16)
    with pytest.raises(InputError, match="cells=4"):
        field_part_solids(small_field(), halves(), 4)
