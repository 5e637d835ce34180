"""Shape diameter and ambient occlusion of known solids."""

import numpy as np
import pytest
import trimesh
from solids import labelled

from jointsdf.geometry.face_graph import face_graph, smooth_regions
from jointsdf.geometry.mesh import face_areas
from jointsdf.shapes.builtin.construction import Construction, box
from jointsdf.shapes.segmentation.ray_features import ambient_occlusion, shape_diameter, spread_points


def test_a_thin_plate_and_the_shaft_of_a_pillar() -> None:
    part = Construction()
    part.add("plate", box((0, 0, 0), (40, 40, 2)))
    part.add("pillar", box((0, 0, 1), (10, 10, 40)))
    part.cut("pit", box((18, 18, 1), (22, 22, 3)), box((4.5, 4.5, 8), (5.5, 5.5, 41)))
    mesh = part.mesh()
    regions = smooth_regions(face_graph(mesh), None)
    surface = spread_points(mesh)
    thickness = surface.region_means(np.log(shape_diameter(surface)), regions)[regions]
    occlusion = surface.region_means(ambient_occlusion(surface), regions)[regions]
    size = np.linalg.norm(np.ptp(mesh.vertices, axis=0))
    centres = mesh.vertices[mesh.faces].mean(axis=1)
    bottom, shaft = centres[:, 2] == 0, (np.abs(centres[:, :2] - 5) < 0.6).all(axis=1) & (centres[:, 2] < 39)
    np.testing.assert_allclose(np.exp(thickness[bottom]) * size, 2.3, rtol=0.15)
    assert (occlusion[bottom] == 0).all()
    assert (occlusion[shaft] > 0.5).all()


def test_points_lie_on_their_faces_and_stand_for_the_whole_area() -> None:
    mesh = labelled(trimesh.creation.box((1, 2, 3)))
    surface = spread_points(mesh)
    half = np.array([1, 2, 3]) / 2 / np.sqrt(14)  # the diagonal is 1
    np.testing.assert_allclose(np.abs(surface.points / half).max(axis=1), 1.0)
    np.testing.assert_allclose(np.bincount(surface.faces, surface.areas), face_areas(mesh))
    np.testing.assert_allclose(np.linalg.det(surface.frames), 1.0)
    on_side = np.abs(np.einsum("nd,nd->n", surface.points, surface.frames[:, 2]))
    np.testing.assert_allclose(on_side, (np.abs(surface.frames[:, 2]) * half).sum(axis=1))


@pytest.mark.parametrize("thickness", [0.05, 0.3])
def test_diameter_of_a_plate_is_its_thickness_along_a_tilted_ray(thickness: float) -> None:
    surface = spread_points(labelled(trimesh.creation.box((4, 4, thickness))))
    inner = (np.abs(surface.frames[:, 2, 2]) > 0.5) & (np.abs(surface.points[:, :2]) < 0.25).all(axis=1)
    diagonal = np.sqrt(32 + thickness**2)
    # Of five rays, one along the normal and four tilted by 35 degrees, the second shortest is a tilted one.
    expected = thickness / np.cos(np.radians(35)) / diagonal
    np.testing.assert_allclose(shape_diameter(surface)[inner], expected, atol=2e-4)


def test_a_convex_solid_is_open_and_the_inside_of_a_cavity_is_occluded() -> None:
    ball = trimesh.creation.icosphere(3)
    assert (ambient_occlusion(spread_points(labelled(ball))) == 0).all()
    ball.invert()
    assert (ambient_occlusion(spread_points(labelled(ball))) == 1).all()
