"""Sharp creases on analytic solids: where they are, what they cost the mesh (nothing), and what stays round."""

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
import trimesh
from analytic import box_distance
from level_sets import as_trimesh, ball, far_apart, torus
from scipy.spatial.transform import Rotation

from jointsdf.extraction.extractor import Extraction
from jointsdf.extraction.sharpening import SharpMesh, sharpen
from jointsdf.geometry.piercings import find_piercings
from jointsdf.values import BOX, Normalisation

RESOLUTION = 96
CELL = 2 * BOX / (RESOLUTION - 1)
TURN = Rotation.from_euler("xyz", [0.31, 0.77, 0.23]).as_matrix()
SIDES = (0.62, 0.47, 0.35)
Sdf = Callable[[np.ndarray], np.ndarray]


def turned_box(points: np.ndarray) -> np.ndarray:
    return box_distance(points @ TURN, SIDES)


def cylinder(points: np.ndarray) -> np.ndarray:
    local = points @ TURN
    beside, above = np.hypot(local[:, 0], local[:, 1]) - 0.5, np.abs(local[:, 2]) - 0.41
    outside = np.hypot(np.maximum(beside, 0), np.maximum(above, 0))
    return outside + np.minimum(np.maximum(beside, above), 0)


def cone(points: np.ndarray) -> np.ndarray:
    """Of half angle 35 degrees about a turned axis, cut at a base: no distance, but a level set known exactly."""
    local = points @ TURN
    radius, angle = np.hypot(local[:, 0], local[:, 1]), np.radians(35.0)
    return np.maximum(radius * np.cos(angle) + (local[:, 2] - 0.6) * np.sin(angle), -local[:, 2] - 0.3)


def roof(points: np.ndarray) -> np.ndarray:
    """Two boxes whose tops meet at 100 degrees: a valley between four ridges."""
    boxes = []
    for side in (1, -1):
        lean = Rotation.from_euler("y", side * np.radians(40.0)).as_matrix()
        boxes.append(box_distance(points @ TURN @ lean - np.array([side * 0.3, 0, 0]), (0.4, 0.33, 0.2)))
    return np.minimum(*boxes)


def wall(points: np.ndarray) -> np.ndarray:
    return box_distance(points @ TURN, (0.7, 0.6, 1.2 * CELL))


def cube(points: np.ndarray) -> np.ndarray:
    """Its sides are 0.3 of a cell from the grid's planes."""
    return box_distance(points, (20.3 * CELL,) * 3)


def drilled(points: np.ndarray) -> np.ndarray:
    local = points @ TURN
    return np.maximum(box_distance(local, SIDES), 0.2 - np.hypot(local[:, 0], local[:, 1]))


def wedge(points: np.ndarray) -> np.ndarray:
    """Two planes that meet at 30 degrees, cut off: no distance, but a level set known exactly."""
    local, lean = points @ TURN, np.radians(15.0)
    slopes = np.cos(lean) * np.abs(local[:, 0]) + np.sin(lean) * (local[:, 2] - 0.6)
    return np.max([slopes, np.abs(local[:, 1]) - 0.5, -local[:, 2] - 0.5], axis=0)


def gap(points: np.ndarray) -> np.ndarray:
    """Two boxes 1.6 cells apart."""
    local = points @ TURN
    shift = np.array([0, 0, 0.3 + 0.8 * CELL])
    return np.minimum(box_distance(local - shift, (0.5, 0.4, 0.3)), box_distance(local + shift, (0.5, 0.4, 0.3)))


def differential(sdf: Sdf) -> Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]:
    def answer(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        steps = 1e-5 * np.eye(3)
        gradients = [(sdf(points + step) - sdf(points - step)) / 2e-5 for step in steps]
        return sdf(points), np.stack(gradients, axis=1)

    return answer


@cache
def sharp(sdf: Sdf) -> tuple[SharpMesh, trimesh.Trimesh]:
    surface = Extraction(RESOLUTION).surface(sdf)
    return sharpen(surface.vertices, surface.faces, differential(sdf), CELL), as_trimesh(surface)


SOLIDS = [cube, turned_box, drilled, cylinder, cone, wedge, roof, wall, gap, torus, far_apart]


def creases(mesh: SharpMesh, degrees: float = 30.0) -> tuple[np.ndarray, np.ndarray]:
    """Middles and lengths of the edges above an angle."""
    found = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    edges = found.face_adjacency_edges[found.face_adjacency_angles > np.radians(degrees)]
    ends = mesh.vertices[edges]
    return ends.mean(axis=1), np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)


@pytest.mark.parametrize("sdf", SOLIDS)
def test_the_mesh_stays_as_sound_as_it_was(sdf: Sdf) -> None:
    mesh, before = sharp(sdf)
    after = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    assert after.is_watertight
    assert after.is_winding_consistent
    assert after.euler_number == before.euler_number
    assert after.body_count == before.body_count
    assert after.volume == pytest.approx(before.volume, rel=0.05)
    assert len(find_piercings(mesh.vertices, mesh.faces).face) == 0
    assert len(np.unique(mesh.faces)) == len(mesh.vertices)


def off_creases(points: np.ndarray) -> np.ndarray:
    """Distance of points from the second nearest of the box's planes: 0 on its edges."""
    return np.sort(np.abs(np.abs(points @ TURN) - SIDES), axis=-1)[..., 1]


def test_a_turned_box_has_its_edges_and_corners() -> None:
    mesh, before = sharp(turned_box)
    middles, lengths = creases(mesh)
    assert off_creases(middles).max() < 1e-3 * CELL
    assert lengths.sum() == pytest.approx(8 * sum(SIDES), rel=1e-6)
    corners = np.abs(np.abs(mesh.vertices[mesh.on_crease] @ TURN) - SIDES).max(axis=1) < 1e-3 * CELL
    assert corners.sum() == 8
    true = 8 * np.prod(SIDES)
    volume = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).volume
    assert abs(volume - true) < abs(before.volume - true) / 10


def test_a_cylinder_has_two_circles() -> None:
    mesh, _ = sharp(cylinder)
    middles, lengths = creases(mesh)
    local = middles @ TURN
    for errors in (np.abs(local[:, 2]) - 0.41, np.hypot(local[:, 0], local[:, 1]) - 0.5):
        assert np.quantile(np.abs(errors), 0.98) < 0.05 * CELL
        assert np.abs(errors).max() < 0.5 * CELL
    assert lengths.sum() == pytest.approx(4 * np.pi * 0.5, rel=0.02)


def test_an_axis_parallel_cube_has_its_edges_and_corners() -> None:
    mesh, _ = sharp(cube)
    half = 20.3 * CELL
    middles, lengths = creases(mesh)
    assert np.sort(np.abs(np.abs(middles) - half), axis=1)[:, 1].max() < 1e-3 * CELL
    assert lengths.sum() == pytest.approx(24 * half, rel=1e-6)
    assert trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).volume == pytest.approx(8 * half**3, rel=1e-6)


def test_an_acute_wedge_has_its_edge() -> None:
    mesh, _ = sharp(wedge)
    middles, lengths = creases(mesh, degrees=120.0)
    local = middles @ TURN
    assert np.quantile(np.hypot(local[:, 0], local[:, 2] - 0.6), 0.75) < 1e-3 * CELL
    assert lengths.sum() == pytest.approx(1.0, rel=0.07)
    assert (mesh.vertices @ TURN)[:, 2].max() == pytest.approx(0.6, abs=1e-3 * CELL)


def test_a_drilled_box_has_two_circles_and_twelve_edges() -> None:
    mesh, _ = sharp(drilled)
    middles, lengths = creases(mesh)
    local = middles @ TURN
    radius = np.hypot(local[:, 0], local[:, 1])
    on_circle = np.hypot(radius - 0.2, np.abs(local[:, 2]) - SIDES[2]) < 0.1 * CELL
    on_edge = off_creases(middles) < 1e-3 * CELL
    assert lengths[on_circle].sum() == pytest.approx(4 * np.pi * 0.2, rel=0.01)
    assert lengths[on_edge].sum() == pytest.approx(8 * sum(SIDES), rel=1e-6)
    assert lengths[~on_circle & ~on_edge].sum() < 0.02 * lengths.sum()


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("noise", [0.05, 0.2, 3.0])
def test_a_field_with_wrong_gradients_costs_no_soundness(noise: float, seed: int) -> None:
    """Where planes disagree, vertices go back: at worst the surface is that of marching cubes."""
    generator = np.random.default_rng(seed)
    exact = differential(turned_box)

    def noisy(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        sdf, gradients = exact(points)
        return sdf, gradients + noise * generator.standard_normal(gradients.shape)

    before = Extraction(48).surface(turned_box)
    mesh = sharpen(before.vertices, before.faces, noisy, 2 * BOX / 47)
    after = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    assert mesh.on_crease.any()
    assert after.is_watertight
    assert after.is_winding_consistent
    assert after.euler_number == 2
    assert len(find_piercings(mesh.vertices, mesh.faces).face) == 0
    assert np.abs(turned_box(mesh.vertices)).max() < 2 * 2 * BOX / 47


@pytest.mark.parametrize("sdf", [ball((0.1, 0.05, -0.02), 0.6), torus])
def test_what_is_smooth_is_left_alone(sdf: Sdf) -> None:
    mesh, _ = sharp(sdf)
    assert not mesh.on_crease.any()
    assert len(creases(mesh)[0]) == 0


def test_part_borders_on_creases_are_edges_of_the_mesh() -> None:
    def by_side(points: np.ndarray) -> np.ndarray:
        local = points @ TURN / SIDES
        axis = np.abs(local).argmax(axis=1)
        return 2 * axis + (np.take_along_axis(local, axis[:, None], 1)[:, 0] > 0)

    mesh = Extraction(RESOLUTION, borders="split", sharp=True).labelled_mesh(
        turned_box, by_side, Normalisation(np.zeros(3), 1.0), differential(turned_box)
    )
    middles = mesh.vertices[mesh.faces].mean(axis=1)
    np.testing.assert_array_equal(mesh.labels, by_side(middles))
    found = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    assert found.is_watertight
    one, other = found.face_adjacency.T
    border = mesh.vertices[found.face_adjacency_edges[mesh.labels[one] != mesh.labels[other]]]
    assert off_creases(border).max() < 1e-3 * CELL
    assert np.linalg.norm(border[:, 1] - border[:, 0], axis=1).sum() == pytest.approx(8 * sum(SIDES), rel=1e-6)


def test_an_empty_mesh_stays_empty() -> None:
    mesh = sharpen(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64), differential(torus), CELL)
    assert len(mesh.vertices) == len(mesh.faces) == len(mesh.on_crease) == 0
