"""Face labels from labels at the vertices: by majority vote, or by cutting faces along the part borders."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

Label = Callable[[Float[ndarray, "n 3"]], Int[ndarray, " n"]]
BISECTIONS = 6  # of an edge: its cut is exact to 1/64 of its length
NEAREST_CUT = 1 / 64  # of the edge: least distance of a cut to a vertex, so that no sliver has zero area


def majority_labels(
    vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"], at_vertices: Int[ndarray, " v"], label: Label
) -> Int[ndarray, " f"]:
    """Label of most of each face's vertices; where all three differ, the label at its centroid.

    Args:
        vertices: Positions, in the frame of `label`.
        faces: Vertex indices.
        at_vertices: Label at each vertex.
        label: Points -> labels.

    >>> corners, face = np.eye(3), np.array([[0, 1, 2]])
    >>> majority_labels(corners, face, np.array([4, 7, 4]), lambda points: np.zeros(len(points), int)).tolist()
    [4]
    """
    first, second, third = at_vertices[faces].T
    labels = np.where(second == third, second, first)
    tied = np.flatnonzero((first != second) & (second != third) & (third != first))
    labels[tied] = label(vertices[faces[tied]].mean(axis=1))
    return labels


def split_at_borders(
    vertices: Float[ndarray, "v 3"],
    faces: Int[ndarray, "f 3"],
    at_vertices: Int[ndarray, " v"],
    label: Label,
    on_crease: Bool[ndarray, " v"] | None = None,
) -> tuple[Float[ndarray, "w 3"], Int[ndarray, "g 3"], Int[ndarray, " g"]]:
    """Cut every face that a border crosses along that border, so that labels are finer than faces.

    The cut of an edge is found by bisection of the label and shared by both of its faces: the surface stays where it
    is and as closed as it was. A face with two labels becomes three, one with three labels six about its centroid.

    A vertex on a crease is on the border between what is on both sides of it, so it has no label of its own: no edge at
    it is cut, and a border along the crease is a line of the mesh's own edges. A face whose other two vertices differ
    becomes two. Where that happens at one vertex of a crease after another, the border only runs beside the crease, and
    these vertices are like any other.

    Args:
        vertices: Positions, in the frame of `label`.
        faces: Vertex indices.
        at_vertices: Label at each vertex.
        label: Points -> labels.
        on_crease: Marks the vertices on creases; None for none.

    Returns:
        Vertices (the given ones first), faces, and the label of each face.
    """
    corner_labels, bound = at_vertices[faces], np.zeros(faces.shape, dtype=bool)
    if on_crease is not None:
        bound = _on_borders(faces, at_vertices, on_crease)[faces]
        corner_labels = _label_bound_corners(corner_labels, bound, vertices, faces, label)
    crosses = corner_labels != np.roll(corner_labels, -1, axis=1)  # edge (i, i+1) crosses a border
    crosses &= ~(bound | np.roll(bound, -1, axis=1))
    crossings = crosses.sum(axis=1)
    ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1)[crosses]
    edges, which = np.unique(np.sort(ends, axis=1), axis=0, return_inverse=True)
    cuts = np.full(faces.shape, -1)
    cuts[crosses] = len(vertices) + which.reshape(-1)
    cut_points = _bisect_label(vertices[edges[:, 0]], vertices[edges[:, 1]], at_vertices[edges[:, 0]], label)
    whole, one, two, three = (crossings == count for count in (0, 1, 2, 3))
    centres = vertices[faces[three]].mean(axis=1)
    pieces = [
        (faces[whole], corner_labels[whole, 0]),
        _split_in_two(faces[one], cuts[one], corner_labels[one]),
        _split_in_three(faces[two], cuts[two], corner_labels[two]),
        _split_in_six(faces[three], cuts[three], corner_labels[three], len(vertices) + len(cut_points)),
    ]
    new_faces, labels = (np.concatenate(column) for column in zip(*pieces, strict=True))
    return np.concatenate([vertices, cut_points, centres]), new_faces, labels


def _on_borders(
    faces: Int[ndarray, "f 3"], at_vertices: Int[ndarray, " v"], on_crease: Bool[ndarray, " v"]
) -> Bool[ndarray, " v"]:
    """The vertices on creases, but for neighbours among them at which one side has two labels."""
    corner_labels, free = at_vertices[faces], ~on_crease[faces]
    leaves = (corner_labels != np.roll(corner_labels, -1, axis=1)) & free & np.roll(free, -1, axis=1)
    face, side = np.nonzero(leaves)
    left = np.zeros_like(on_crease)
    left[faces[face, (side + 2) % 3]] = True
    ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2)
    kept = on_crease.copy()
    kept[ends[left[ends].all(axis=1)]] = False
    return kept


def _label_bound_corners(
    corner_labels: Int[ndarray, "f 3"],
    bound: Bool[ndarray, "f 3"],
    vertices: Float[ndarray, "v 3"],
    faces: Int[ndarray, "f 3"],
    label: Label,
) -> Int[ndarray, "f 3"]:
    """Give corners on creases the label of a corner of their face that is not on one, else that at its centroid."""
    free = np.argmax(~bound, axis=1)
    own = corner_labels[np.arange(len(faces)), free]
    all_bound = np.flatnonzero(bound.all(axis=1))
    if len(all_bound):
        own[all_bound] = label(vertices[faces[all_bound]].mean(axis=1))
    return np.where(bound, own[:, None], corner_labels)


def _bisect_label(
    starts: Float[ndarray, "e 3"], ends: Float[ndarray, "e 3"], start_labels: Int[ndarray, " e"], label: Label
) -> Float[ndarray, "e 3"]:
    """Point of each edge at which the label of its start ends, by bisection."""
    low, high = np.zeros((len(starts), 1)), np.ones((len(starts), 1))
    for _ in range(BISECTIONS if len(starts) else 0):
        middle = (low + high) / 2
        same = (label(starts + middle * (ends - starts)) == start_labels)[:, None]
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return starts + np.clip((low + high) / 2, NEAREST_CUT, 1 - NEAREST_CUT) * (ends - starts)


def _split_in_two(
    faces: Int[ndarray, "f 3"], cuts: Int[ndarray, "f 3"], labels: Int[ndarray, "f 3"]
) -> tuple[Int[ndarray, "g 3"], Int[ndarray, " g"]]:
    """Cut from the corner on a crease to the edge opposite it."""
    turn = (np.argmax(cuts >= 0, axis=1)[:, None] + np.arange(3)) % 3  # the cut edge first, same winding
    (a, b, c), cut = np.take_along_axis(faces, turn, 1).T, np.take_along_axis(cuts, turn, 1)[:, 0]
    first, second, _ = np.take_along_axis(labels, turn, 1).T
    triangles = [np.stack([a, cut, c], axis=1), np.stack([cut, b, c], axis=1)]
    return np.concatenate(triangles), np.concatenate([first, second])


def _split_in_three(
    faces: Int[ndarray, "f 3"], cuts: Int[ndarray, "f 3"], labels: Int[ndarray, "f 3"]
) -> tuple[Int[ndarray, "g 3"], Int[ndarray, " g"]]:
    """Cut off the corner with a label of its own; the uncut edge is opposite it."""
    uncut = np.argmax(cuts < 0, axis=1)
    turn = (uncut[:, None] + np.array([2, 0, 1])) % 3  # the corner cut off first, same winding
    (a, b, c), (ab, _, ca) = np.take_along_axis(faces, turn, 1).T, np.take_along_axis(cuts, turn, 1).T
    own, shared, _ = np.take_along_axis(labels, turn, 1).T
    triangles = [np.stack(corners, axis=1) for corners in ((a, ab, ca), (ab, b, c), (ab, c, ca))]
    return np.concatenate(triangles), np.concatenate([own, shared, shared])


def _split_in_six(
    faces: Int[ndarray, "f 3"], cuts: Int[ndarray, "f 3"], labels: Int[ndarray, "f 3"], first_centre: int
) -> tuple[Int[ndarray, "g 3"], Int[ndarray, " g"]]:
    """Give each corner of a face with three labels a third of it, about the centroid."""
    centre = first_centre + np.arange(len(faces))
    triangles, owners = [], []
    for i in range(3):
        for corners in ((faces[:, i], cuts[:, i], centre), (cuts[:, i - 1], faces[:, i], centre)):
            triangles.append(np.stack(corners, axis=1))
        owners += [labels[:, i], labels[:, i]]
    return np.concatenate(triangles), np.concatenate(owners)
