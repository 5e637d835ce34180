"""Features of regions and borders of known solids."""

import numpy as np
import trimesh
from solids import labelled

from jointsdf.geometry.face_graph import face_graph, smooth_regions
from jointsdf.shapes.builtin.construction import Construction, box, rod
from jointsdf.shapes.segmentation.region_features import RegionFeatures, measure_regions
from jointsdf.values import LabelledMesh


def features(mesh: LabelledMesh) -> tuple[RegionFeatures, np.ndarray]:
    """The features of the smooth regions, and the mean position of the faces of each."""
    graph = face_graph(mesh)
    regions = smooth_regions(graph, None)
    centres = mesh.vertices[mesh.faces].mean(axis=1)
    return measure_regions(mesh, graph, regions), np.array(
        [centres[regions == region].mean(axis=0) for region in range(regions.max() + 1)]
    )


def test_sides_of_a_box_have_their_areas_borders_and_right_angles() -> None:
    found, centres = features(labelled(trimesh.creation.box((1, 2, 3))))
    np.testing.assert_allclose(found.areas.sum(), 1.0)
    np.testing.assert_allclose(np.sort(found.areas), np.array([2, 2, 3, 3, 6, 6]) / 22)
    axes = np.abs(centres).argmax(axis=1)
    along = 3 - axes[found.pairs].sum(axis=1)  # the axis that the border of two sides follows
    np.testing.assert_allclose(found.lengths, np.array([1, 2, 3])[along] / np.sqrt(14))
    assert len(found.pairs) == 12
    np.testing.assert_allclose(found.convex, 1.0)
    np.testing.assert_allclose(found.concave, 0.0, atol=1e-12)
    np.testing.assert_allclose(found.hollow, 0.0)


def test_a_concave_crease_and_the_wall_of_a_hole_are_seen() -> None:
    part = Construction()
    part.add("foot", box((0, 0, 0), (10, 4, 2)))
    part.add("wall", box((0, 0, 0), (2, 4, 10)))
    part.cut("hole", rod((6, 2, -1), 5, 1.2))
    found, centres = features(part.mesh())
    np.testing.assert_allclose(found.areas.sum(), 1.0)
    [crease] = np.flatnonzero(found.concave > 0.9)
    ends = centres[found.pairs[crease]]
    np.testing.assert_allclose([ends[:, 0].min(), ends[:, 2].min()], 2, atol=1e-5)  # wall and foot
    hole = int(np.argmin(np.linalg.norm(centres - (6, 2, 1), axis=1)))
    assert found.hollow[hole] == found.hollow.max() > 0.9


def test_the_flat_bottom_of_a_pit_is_hollow_and_the_top_around_it_is_not() -> None:
    part = Construction()
    part.add("block", box((0, 0, 0), (10, 10, 10)))
    part.cut("pit", box((4, 4, 3), (6, 6, 11)))
    found, centres = features(part.mesh())
    bottom, top = (int(np.argmin(np.linalg.norm(centres - place, axis=1))) for place in ((5, 5, 3), (5, 5, 10)))
    assert found.hollow[bottom] > 0.9
    assert found.hollow[top] < 0.05
