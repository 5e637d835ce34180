"""Pieces of a page against what is known: packing, merging, errors, grids, numbers."""

import hashlib
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from analytic import box_distance, sphere_distance
from labelled_meshes import box, by_side
from solids import labelled
from study_rows import NAN, make_row

from jointsdf.geometry.distance import ClosestPoint, ExactDistance
from jointsdf.values import UNMOVED, LabelledMesh
from jointsdf.viewing.page import document
from jointsdf.viewing.page.display import display
from jointsdf.viewing.page.errors import errors_of_fit
from jointsdf.viewing.page.field_grid import NEAR, sample_grid
from jointsdf.viewing.page.numbers import lines
from jointsdf.viewing.page.packing import pack, quantise, unpack


def test_arrays_come_back_as_they_were() -> None:
    rng = np.random.default_rng(0)
    arrays = {
        "bytes": rng.integers(0, 255, 7).astype(np.uint8),  # the next array begins at a multiple of four bytes
        "signed": rng.integers(-32767, 32767, 5).astype(np.int16),
        "none": np.zeros(0, dtype=np.uint16),
        "large": rng.integers(0, 2**32 - 1, (3, 4)).astype(np.uint32),
    }
    packed = pack(arrays)
    assert all(start % 4 == 0 for _, _, start, _ in packed["arrays"])
    found = unpack(packed)
    assert found.keys() == arrays.keys()
    for name, array in arrays.items():
        assert found[name].dtype == array.dtype
        np.testing.assert_array_equal(found[name], array.reshape(-1))
    assert pack(arrays) == packed, "the same bytes on any day"


def test_quantised_points_are_within_half_a_step() -> None:
    points = np.random.default_rng(1).uniform((1e6, -3, 0), (1e6 + 10, 5, 1e-3), (500, 3))
    points[:, 1] = 2.5  # flat along an axis
    steps, box_of = quantise(points)
    back = np.array(box_of["low"]) + steps * np.array(box_of["step"])
    assert (np.abs(back - points) <= np.array(box_of["step"]) / 2 + 1e-9).all()


def test_a_cube_is_shown_by_its_edges_and_halved_faces() -> None:
    cube = box(by_side, 2.0)
    shown = display(cube, 400)
    assert shown.moved == 0
    assert len(cube.faces) < len(shown.mesh.faces) <= 520
    corners = shown.mesh.vertices[shown.mesh.faces]
    assert shown.longest == pytest.approx(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max())
    assert shown.longest < 0.6
    areas = np.bincount(shown.mesh.labels, trimesh.triangles.area(corners))
    np.testing.assert_allclose(areas, np.bincount(cube.labels, trimesh.triangles.area(cube.vertices[cube.faces])))
    ends = shown.mesh.vertices[shown.lines]
    assert (np.isclose(np.abs(ends), 1).sum(axis=2) >= 2).all(), "on the edges"
    lengths = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1)
    assert lengths.sum() == pytest.approx(12 * 2 + 12 * 2), "each edge once for each of its two parts"


@pytest.mark.parametrize("open_at_the_top", [False, True])
def test_a_merged_surface_is_as_near_as_it_says(open_at_the_top: bool) -> None:
    solid = trimesh.creation.icosphere(5, radius=3.0)
    ball = labelled(solid, (solid.triangles_center[:, 2] > 0).astype(int) * 4 - 1)  # unlabelled below
    if open_at_the_top:
        kept = solid.triangles_center[:, 2] < 2.5
        ball = LabelledMesh(ball.vertices, ball.faces[kept], ball.labels[kept])
    shown = display(ball, 3000)
    assert shown.full_faces == len(ball.faces) > 2 * len(shown.mesh.faces)
    assert 0 < shown.moved < (0.02 if open_at_the_top else 0.006) * 6
    apart = ClosestPoint(shown.mesh).query(ball.vertices[np.unique(ball.faces)])[0].max()
    assert apart <= shown.moved * 1.05, "measured at every second vertex"
    assert set(np.unique(shown.mesh.labels)) == {-1, 3}


def test_errors_of_a_grown_box_are_how_much_it_grew() -> None:
    truth, grown = box(by_side, 2.0), box(by_side, 2.2)
    turned = replace(grown, labels=np.where(grown.labels == 2, 1, grown.labels))
    shown = display(turned, 2000)
    exact = ExactDistance(truth, watertight=True)
    errors = errors_of_fit(truth, exact, ClosestPoint(turned), shown.mesh)
    inner = (np.abs(shown.mesh.vertices) < 1).sum(axis=1) == 2
    assert errors.error is not None
    assert errors.normal is not None
    assert errors.wrong is not None
    np.testing.assert_allclose(errors.error[inner], 0.1, atol=1e-12)
    np.testing.assert_allclose(errors.error, box_distance(shown.mesh.vertices, (1, 1, 1)), atol=1e-12)
    middles = shown.mesh.vertices[shown.mesh.faces].mean(axis=1)
    flat = (np.abs(middles) < 1).sum(axis=1) == 2
    np.testing.assert_allclose(errors.normal[flat], 0, atol=1e-6)
    assert (errors.wrong[flat] == (by_side(_normals(shown.mesh))[flat] == 2)).all()


def _normals(mesh: LabelledMesh) -> np.ndarray:
    corners = mesh.vertices[mesh.faces]
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def test_a_grid_says_how_far_it_is_from_the_field() -> None:
    low, high = np.array([-0.6] * 3), np.array([0.6] * 3)
    grid = sample_grid(lambda points: sphere_distance(points, 0.6), UNMOVED, low, high, 33)
    ticks = [np.linspace(grid.low[k], grid.high[k], 33) for k in range(3)]
    z, y, x = np.meshgrid(ticks[2], ticks[1], ticks[0], indexing="ij")
    exact = sphere_distance(np.stack([x, y, z], axis=-1).reshape(-1, 3), 0.6).reshape(33, 33, 33)
    step = 1 / 254  # of the root of the share of the largest value
    allowed = grid.largest * (2 * np.sqrt(np.abs(exact) / grid.largest) * step + step**2) + 1e-12
    assert (np.abs(grid.decoded - exact) <= allowed).all(), "rounding of a byte, z slowest"
    assert (np.sign(grid.decoded) * np.sign(exact) >= 0).all()
    assert grid.near_p99 < 0.01 * NEAR / 0.05 * 1.2
    assert sample_grid(lambda points: sphere_distance(points, 0.6), UNMOVED, low, high, 9).near_p99 > 2 * grid.near_p99
    wide = sample_grid(lambda points: points[:, 0], UNMOVED, np.array([-1.1] * 3), np.array([1.1] * 3), 5)
    np.testing.assert_allclose(
        [wide.low, wide.high], [[-1.1] * 3, [1.1] * 3], err_msg="no further than the training box"
    )


def test_numbers_stand_beside_their_references_and_are_blank_where_missing() -> None:
    scores = {"cd_l1": 0.5, "cd_l1_floor": 0.4, "surface_p99": 0.01, "nc": NAN, "components": 2.0, "components_gt": 1.0}
    rows = [make_row(**scores), make_row(head="siren", cd_l1=NAN, surface_p99=0.02)]
    found = {line.name.split(" ")[0]: line for line in lines(rows, "unit", 50.0, "mm")}
    assert found["Chamfer"].cells == ["0.5", ""]
    assert found["Chamfer"].beside == "floor: two samplings of the truth itself give 0.4"
    assert found["99%"].cells == ["0.5 mm (1% of the longest side)", "1 mm (2% of the longest side)"]
    assert (found["pieces"].cells[0], found["pieces"].beside) == ("2", "the truth has 1")
    assert "agreement" not in found, "no run has it"


def test_three_js_is_the_package_that_its_readme_names() -> None:
    text = document.ASSETS.joinpath("three", "README.md").read_text(encoding="utf-8")
    named = dict(re.findall(r"^\| `(\S+)` \| .*`([0-9a-f]{64})` \|$", text, re.MULTILINE))
    assert named.keys() == {*document.THREE, "LICENSE"}
    for name, sha256 in named.items():
        assert hashlib.sha256(document.ASSETS.joinpath("three", name).read_bytes()).hexdigest() == sha256


def test_scripts_import_what_is_there_and_nothing_of_the_network() -> None:
    own = Path(str(document.ASSETS)), Path(__file__).parents[3] / "jointsdf" / "study" / "page" / "assets"
    scripts = [path for folder in own for path in folder.glob("*.js")]
    known = {f"page/{path.name}" for path in scripts} | set(document.THREE.values())
    for path in scripts:
        text = path.read_text(encoding="utf-8")
        assert set(re.findall(r' from "([^"]+)"', text)) <= known, path.name
        assert not re.search(r"https?:(?!//www\.w3\.org/2000/svg)|fetch\(|XMLHttpRequest|innerHTML|eval\(", text), (
            path.name
        )
        assert len(text.splitlines()) <= 200
