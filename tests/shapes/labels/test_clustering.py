"""Connected parts of like features."""

import numpy as np
import trimesh
from partfield_output import BAR, SECTION
from sklearn.metrics import adjusted_rand_score

from jointsdf.shapes.labels.clustering import cluster_features


def test_parts_of_a_cut_are_connected_and_bodies_apart_can_share_one() -> None:
    bodies = [
        trimesh.creation.box(transform=trimesh.transformations.translation_matrix((3 * i, 0, 0))) for i in range(5)
    ]
    corners = np.concatenate([body.subdivide().triangles for body in bodies])
    kind = np.repeat([0, 0, 1, 0, 0], len(corners) // 5)
    features = np.eye(4)[kind] + np.random.default_rng(0).normal(0, 0.01, (len(corners), 4))
    parts = cluster_features(features, corners, 3)
    assert adjusted_rand_score(parts, np.repeat([0, 0, 1, 2, 2], len(corners) // 5)) == 1.0


def test_a_single_piece_with_two_patches_of_like_features_is_not_one_part() -> None:
    features = np.eye(3)[np.isin(SECTION, (0, 3)).astype(int)]  # both ends alike, the middle differs
    parts = cluster_features(features, BAR.triangles, 3)
    assert adjusted_rand_score(parts, np.digitize(SECTION, [1, 3])) == 1.0
