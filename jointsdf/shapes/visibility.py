"""Outer side of open patches by casting rays.

Takayama et al., "A simple method for correcting facet orientations in polygon meshes based on ray casting", JCGT 2014,
count on both sides the rays that escape, and compare lengths where none does. Here the rays count that pass through an
even number of faces, as all do that start outside of a closed surface: this holds for the walls of a cavity as well.
"""

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from jointsdf.geometry.rays import ray_hits, successive_hits

LINES = 100_000  # over all patches
FEWEST, LARGEST = 8, 1000  # lines of one patch
LIFT = 2e-6  # of the starts from the surface, of the longest side
DEVIATIONS = 3  # standard deviations of the votes beyond which they are clear
ALIKE = 0.01  # relative difference of the areas of two patches at one place at most


def vote_on_sides(
    vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"], patch: Int[ndarray, " f"], twins: Bool[ndarray, " f"]
) -> Int[ndarray, " p"]:
    """Find for each patch whether it is clearly wound outward: 1; inside out: -1; or the same on both sides: 0.

    Args:
        vertices: Positions.
        faces: Vertex indices, none degenerate.
        patch: Patch of each face, numbered from 0; within one they agree about the outside.
        twins: Faces that are there twice. Both sides of a sheet at one place stop no ray, and have no outer side.
    """
    count = int(patch.max()) + 1
    lines = int(np.clip(LINES // count, FEWEST, LARGEST))
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    corners = ((vertices - (low + high) / 2) / float((high - low).max()))[faces]
    generator = np.random.default_rng(0)
    points, normals = _draw_in_patches(corners, patch, lines, generator)
    directions = generator.standard_normal(points.shape)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    directions *= np.where(np.einsum("ij,ij->i", directions, normals) < 0, -1, 1)[:, None]
    flat = (np.bincount(patch, twins) > 0) | _find_coincident(corners, patch, points, normals)
    blocking = corners[~flat[patch]]
    outer = _starts_outside(blocking, points + LIFT * normals, directions)
    inner = _starts_outside(blocking, points - LIFT * normals, -directions)
    votes = (outer.astype(int) - inner).reshape(count, lines).sum(axis=1)
    return np.where(flat | (np.abs(votes) <= DEVIATIONS * np.sqrt(lines / 2)), 0, np.sign(votes))


def _find_coincident(
    corners: Float[ndarray, "f 3 3"],
    patch: Int[ndarray, " f"],
    points: Float[ndarray, "n 3"],
    normals: Float[ndarray, "n 3"],
) -> Bool[ndarray, " p"]:
    """Find the patches at whose place is another one of the same area: most rays onto the one meet the other."""
    count = int(patch.max()) + 1
    own = np.repeat(np.arange(count), len(points) // count)
    lengths, hit = ray_hits(corners, points + LIFT * normals, -normals)
    met = np.where(lengths < 2 * LIFT, patch[hit], own)
    a, b, c = corners.swapaxes(0, 1)
    areas = np.bincount(patch, np.linalg.norm(np.cross(b - a, c - a), axis=1))
    foreign = (met != own) & (np.abs(areas[met] - areas[own]) < ALIKE * areas[own])
    one = np.bincount(own, foreign, minlength=count) > 0.5 * len(points) / count
    found = one.copy()
    found[met[foreign & one[own]]] = True
    return found


def _draw_in_patches(
    corners: Float[ndarray, "f 3 3"], patch: Int[ndarray, " f"], each: int, generator: np.random.Generator
) -> tuple[Float[ndarray, "n 3"], Float[ndarray, "n 3"]]:
    """Draw points uniform by area, the same number in every patch, one patch after the other; with their normals."""
    order = np.argsort(patch, kind="stable")
    a, b, c = corners[order].swapaxes(0, 1)
    normals = np.cross(b - a, c - a)
    doubled_areas = np.linalg.norm(normals, axis=1)
    ends = np.cumsum(doubled_areas)
    last = np.cumsum(np.bincount(patch)) - 1
    until = ends[last]
    since = np.concatenate([[0.0], until[:-1]])
    first = np.concatenate([[0], last[:-1] + 1])
    wanted = since[:, None] + generator.random((len(last), each)) * (until - since)[:, None]
    chosen = np.clip(np.searchsorted(ends, wanted, side="right"), first[:, None], last[:, None]).ravel()
    s, t = generator.random((2, len(chosen), 1))
    s, t = np.where(s + t > 1, 1 - s, s), np.where(s + t > 1, 1 - t, t)
    points = a[chosen] + s * (b - a)[chosen] + t * (c - a)[chosen]
    return points, (normals / doubled_areas[:, None])[chosen]


def _starts_outside(corners: ndarray, origins: ndarray, directions: ndarray) -> Bool[ndarray, " n"]:
    """Whether each ray passes through an even number of faces."""
    even = np.ones(len(origins), dtype=bool)
    for rays, _ in successive_hits(corners, origins, directions, np.full(len(origins), np.inf)):
        even[rays] ^= True
    return even
