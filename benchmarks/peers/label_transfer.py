"""Labels of a mesh's faces from those of the cloud it was made of."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.spatial import KDTree

from benchmarks.peers.graph_cut import cut_labels
from jointsdf.geometry.face_graph import face_graph
from jointsdf.geometry.mesh import face_areas
from jointsdf.values import UNLABELLED, LabelledMesh

VOTERS = 15  # nearest points of a face, where most of them win
CUT_VOTERS = 5  # where neighbouring faces speak as well: fewer of them leave small parts more


def votes_of(
    mesh: LabelledMesh, points: Float[ndarray, "n 3"], labels: Int[ndarray, " n"], voters: int
) -> Int[ndarray, "f k"]:
    """How many of the nearest labelled points of each face's centroid have each class 0..K-1.

    Args:
        mesh: In the points' frame.
        points: The cloud.
        labels: Class of each point, -1 where unlabelled; one of them has a class.
        voters: Points that are asked; fewer where the cloud has fewer.
    """
    known = labels != UNLABELLED
    points, labels = points[known], labels[known]
    centroids = mesh.vertices[mesh.faces].mean(axis=1)
    nearest = labels[KDTree(points).query(centroids, range(1, min(voters, len(points)) + 1))[1]]
    votes = np.zeros((len(centroids), int(labels.max()) + 1), dtype=np.int64)
    np.add.at(votes, (np.arange(len(centroids))[:, None], nearest), 1)
    return votes


def nearest_labels(mesh: LabelledMesh, points: Float[ndarray, "n 3"], labels: Int[ndarray, " n"]) -> Int[ndarray, " f"]:
    """Class of the point nearest to each face."""
    return votes_of(mesh, points, labels, 1).argmax(axis=1)


def voted_labels(mesh: LabelledMesh, points: Float[ndarray, "n 3"], labels: Int[ndarray, " n"]) -> Int[ndarray, " f"]:
    """Class that most of the 15 nearest points have; of several that of the nearest point, else the first."""
    votes = 2 * votes_of(mesh, points, labels, VOTERS) + votes_of(mesh, points, labels, 1)
    return votes.argmax(axis=1)


def smooth_labels(mesh: LabelledMesh, points: Float[ndarray, "n 3"], labels: Int[ndarray, " n"]) -> Int[ndarray, " f"]:
    """Classes among the votes that minimise disagreement with them plus the length of the borders; see `cut_labels`."""
    with np.errstate(invalid="ignore"):  # a face without area has no normal
        graph = face_graph(mesh)
    bent = np.nan_to_num(np.abs(graph.angles))
    votes = votes_of(mesh, points, labels, CUT_VOTERS)
    return cut_labels(votes, face_areas(mesh), graph.pairs, graph.lengths, bent)


TRANSFERS: dict[str, Callable[..., Int[ndarray, " f"]]] = {
    "nearest": nearest_labels,
    "vote": voted_labels,
    "cut": smooth_labels,
}
