"""Which closed bodies of a mesh lie inside which: boxes first, then winding numbers."""

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.spatial import KDTree

from jointsdf.geometry.distance import ClosestPoint
from jointsdf.geometry.piercings import find_piercings
from jointsdf.geometry.winding import WindingNumber
from jointsdf.values import LabelledMesh

POINTS = 8  # of a body that are asked whether they are inside another one
BENEATH = 1e-3  # depth of these under their face, of the root of twice its area
SLACK = 1e-6  # by which a body may stick out of the box of another one that it is in, of the longest side
SAME = 0.999  # share of another body's volume from which one may be that body once more, in other triangles


def nesting_depth(
    vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"], body: Int[ndarray, " f"], volumes: Float[ndarray, " b"]
) -> Int[ndarray, " b"]:
    """Number of other bodies that each body lies in, wholly: those that pass through each other are not nested.

    Nor is a body that is there twice, in other triangles and of one winding; of two windings they are a cavity and its
    filling.

    Args:
        vertices: Positions.
        faces: Vertex indices, those of bodies wound outward.
        body: Closed body of each face, numbered from 0; -1 for faces of none, which together count as another body.
        volumes: Of the bodies, negative for those that were wound inward.
    """
    members = [np.flatnonzero(body == -1), *_members(body, len(volumes))]
    rest, bodies = members[0], members[1:]
    depth = np.zeros(len(bodies), dtype=np.int64)
    inner, outer = _within_boxes(vertices, faces, bodies, np.abs(volumes))
    if len(inner):
        apart = ~_cross(vertices, faces, body, inner, outer, len(bodies))
        apart &= ~_coincide(vertices, faces, bodies, volumes, inner, outer)
        inner, outer = inner[apart], outer[apart]
    order = np.argsort(outer, kind="stable")
    for group in np.split(order, np.flatnonzero(np.diff(outer[order])) + 1) if len(order) else []:
        winding = WindingNumber(vertices, faces[bodies[outer[group[0]]]])
        depth[inner[group]] += _are_inside(winding, vertices, faces, [bodies[index] for index in inner[group]])
    if len(rest) and len(bodies):
        depth += _are_inside(WindingNumber(vertices, faces[rest]), vertices, faces, bodies)
    return depth


def _members(body: Int[ndarray, " f"], count: int) -> list[ndarray]:
    """Faces of each body."""
    order = np.argsort(body, kind="stable")
    return np.split(order, np.searchsorted(body[order], np.arange(count)))[1:]


def _within_boxes(
    vertices: ndarray, faces: ndarray, bodies: list[ndarray], volumes: Float[ndarray, " b"]
) -> tuple[Int[ndarray, " p"], Int[ndarray, " p"]]:
    """Pairs of a body and a larger one whose box it is in."""
    spans = [vertices[faces[members].ravel()] for members in bodies]
    lows, highs = np.array([span.min(axis=0) for span in spans]), np.array([span.max(axis=0) for span in spans])
    slack = SLACK * np.ptp(vertices, axis=0).max()
    middles, reach = (lows + highs) / 2, (highs - lows).max(axis=1) / 2 + slack
    near = KDTree(middles).query_ball_point(middles, reach, p=np.inf)
    outer = np.repeat(np.arange(len(bodies)), [len(found) for found in near])
    inner = np.concatenate([np.array(found, dtype=np.int64) for found in near])
    larger = (volumes[outer] > volumes[inner]) | ((volumes[outer] == volumes[inner]) & (outer < inner))
    inside = (lows[inner] >= lows[outer] - slack).all(axis=1) & (highs[inner] <= highs[outer] + slack).all(axis=1)
    return inner[larger & inside], outer[larger & inside]


def _cross(
    vertices: ndarray, faces: ndarray, body: ndarray, inner: ndarray, outer: ndarray, count: int
) -> Bool[ndarray, " p"]:
    """Whether the surfaces of each pair of bodies pass through each other."""
    found = find_piercings(vertices, faces)
    one, other = body[found.face], body[found.pierced]
    crossing = np.concatenate([one * count + other, other * count + one])[np.tile((one >= 0) & (other >= 0), 2)]
    return np.isin(inner * count + outer, crossing)


def _coincide(
    vertices: ndarray, faces: ndarray, bodies: list[ndarray], volumes: ndarray, inner: ndarray, outer: ndarray
) -> Bool[ndarray, " p"]:
    """Whether the bodies of each pair have equal signed volumes, and some faces of one their middles on the other."""
    slack = SLACK * np.ptp(vertices, axis=0).max()
    same = volumes[inner] / volumes[outer] >= SAME
    for pair in np.flatnonzero(same):
        middles = vertices[faces[_choose(bodies[inner[pair]])]].mean(axis=1)
        held = faces[bodies[outer[pair]]]
        surface = ClosestPoint(LabelledMesh(vertices, held, np.zeros(len(held), dtype=np.int64)))
        same[pair] = surface.query(middles)[0].max() <= slack
    return same


def _choose(members: Int[ndarray, " f"]) -> Int[ndarray, " n"]:
    """Choose a few of a body's faces, evenly in their order."""
    return members[np.linspace(0, len(members) - 1, POINTS).astype(int)]


def _are_inside(
    winding: WindingNumber, vertices: ndarray, faces: ndarray, bodies: list[ndarray]
) -> Bool[ndarray, " b"]:
    """Whether most points just beneath some faces of each body are inside another one."""
    chosen = np.concatenate([_choose(members) for members in bodies])
    a, b, c = vertices[faces[chosen].T]
    normals = np.cross(b - a, c - a)
    beneath = (a + b + c) / 3 - BENEATH * normals / np.sqrt(np.linalg.norm(normals, axis=1, keepdims=True))
    return winding.encloses(beneath).reshape(-1, POINTS).mean(axis=1) > 0.5
