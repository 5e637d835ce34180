"""Sphere tracing of fitted fields from far away, against exact ray casting (Hart, "Sphere tracing", 1996).

Rays start well outside the training box, where the field answers a lower bound, and aim at random points of the shape's
box. A ray is lost where the exact one hits a face, not at a grazing angle, and the traced one ends elsewhere: it steps
out of the scene, or ends more than `LOST` behind the hit.
"""

import os
import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

import jointsdf
from benchmarks.table import Row
from jointsdf.evaluation.protocol import bounding_frame
from jointsdf.geometry.distance import network_distance
from jointsdf.geometry.mesh import face_normals
from jointsdf.geometry.rays import ray_hits
from jointsdf.model.query import OutsideBoxWarning
from jointsdf.shapes import abc, load

SHAPES = ("abc_0001", "abc_0016", "abc_0023", "abc_0034", "abc_0046")
FAR = 3.0  # distance of the starts from the middle, longest side 1
HIT, STEPS = 1e-5, 300  # value below which a ray has arrived, and steps after which it is given up
GRAZING = 5.0  # degrees
LOST = 0.01  # of the longest side, behind the exact hit

Value = Callable[[Float[ndarray, "n 3"]], Float[ndarray, " n"]]


def rows(shapes: Sequence[str] = SHAPES, rays: int = 10_000, overrides: Sequence[str] = ()) -> list[Row]:
    """Distances of the hits to the true surface, and lost rays, of each shape.

    Args:
        shapes: Names; those of ABC are left out where their meshes are not at hand.
        rays: Of each shape.
        overrides: Of the fit, to make it smaller; then nothing is claimed.
    """
    root = os.environ.get("JOINTSDF_ABC", "")
    found = []
    for name in shapes:
        if name in abc.catalogue() and not (root and abc.mesh_path(name, root).is_file()):
            continue
        shape = load(name, abc_root=root or "data/abc", abc_missing="error")
        fitted = jointsdf.fit(shape, overrides=overrides, quiet=True)
        frame = bounding_frame(shape.mesh)

        def value(points: Float[ndarray, "n 3"], fitted=fitted, frame=frame) -> Float[ndarray, " n"]:
            with warnings.catch_warnings(action="ignore", category=OutsideBoxWarning):
                found: ndarray = fitted.field.query(frame.inverse(points), what="sdf").sdf
            return found.astype(np.float64) / frame.scale

        corners = frame.forward(shape.mesh.vertices)[shape.mesh.faces]
        ends, lost = compare(value, corners, rays)
        errors = network_distance(shape, frame).closest.query(ends)[0] if len(ends) else np.zeros(0)
        median, p99 = np.percentile(errors, (50, 99)) if len(errors) else (np.nan, np.nan)
        allowed = 2 * fitted.scores["surface_p99"]
        claims = (
            Row(f"{name}: hits, median to the surface", "longest side", median, 1.0, "", median, 5e-4, at_least=False),
            Row(f"{name}: hits, p99", "2 x surface_p99", p99, allowed, "", p99 / allowed, 1.0, at_least=False),
            Row(f"{name}: lost rays", "rays that do not graze", lost, 1.0, "", lost, 5e-4, at_least=False),
        )
        found += claims
    return [replace(row, target=None) for row in found] if overrides else found


def compare(value: Value, corners: Float[ndarray, "f 3 3"], rays: int) -> tuple[Float[ndarray, "h 3"], float]:
    """Trace rays through a distance and cast them at its surface; ends of those that both hit, and the share lost.

    Args:
        value: The distance, in the frame of the corners.
        corners: Of the true faces; longest side 1, about the origin.
        rays: Number of rays.
    """
    generator = np.random.default_rng(0)
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    origins = generator.standard_normal((rays, 3))
    origins *= FAR / np.linalg.norm(origins, axis=1, keepdims=True)
    directions = generator.uniform(low, high, (rays, 3)) - origins
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    known, face = ray_hits(corners, origins, directions)
    flat = corners.reshape(-1, 3)
    normals = face_normals(flat, np.arange(len(flat)).reshape(-1, 3))[face]
    steep = np.isfinite(known) & (np.abs(np.einsum("ij,ij->i", normals, directions)) > np.sin(np.radians(GRAZING)))
    travelled = trace(value, origins, directions)
    lost = steep & ~(travelled < known + LOST)
    both = steep & ~lost
    return origins[both] + travelled[both, None] * directions[both], float(lost.sum() / max(steep.sum(), 1))


def trace(value: Value, origins: Float[ndarray, "n 3"], directions: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
    """Length of each ray where the value falls below `HIT`, infinite for one that leaves or does not arrive.

    Args:
        value: The distance.
        origins: Starts of the rays.
        directions: Unit vectors.
    """
    lengths, active = np.zeros(len(origins)), np.arange(len(origins))
    for _ in range(STEPS):
        step = value(origins[active] + lengths[active, None] * directions[active])
        lengths[active] += np.where(step < HIT, 0.0, step)
        active = active[(step >= HIT) & (lengths[active] < 2 * FAR)]
        if not len(active):
            return np.where(lengths < 2 * FAR, lengths, np.inf)
    lengths[active] = np.inf
    return np.where(lengths < 2 * FAR, lengths, np.inf)
