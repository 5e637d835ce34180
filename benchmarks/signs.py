"""Signs of the distance by pseudonormal and by fast winding number, against the exact winding number.

The points are those of a run's pool: half of them near the surface, the others anywhere in the box. The exact winding
number is the sum of the solid angles of all faces (Jacobson et al., "Robust inside-outside segmentation using
generalized winding numbers", SIGGRAPH 2013), by libigl.
"""

import os
from collections.abc import Callable, Sequence
from dataclasses import replace

import igl
import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from benchmarks.table import Row
from jointsdf.data.point_cloud import Cloud, draw_pool
from jointsdf.geometry.distance import network_distance
from jointsdf.shapes import abc, load
from jointsdf.shapes.builtin import BUILTINS
from jointsdf.values import Shape

INSIDE = 0.5  # winding number above which a point is inside
WAYS: dict[str, Callable[[Shape], Shape]] = {
    "pseudonormal": lambda shape: replace(shape, watertight=True, folded=False),
    "fast winding number": lambda shape: replace(shape, watertight=False),
    "as loaded": lambda shape: shape,
}


def rows(points: int = 2000, most: int = 50) -> list[Row]:
    """Points on the wrong side, over all shapes of a catalogue and on the worst one.

    Args:
        points: Of each shape.
        most: Shapes of each catalogue.
    """
    root = os.environ.get("JOINTSDF_ABC", "")
    real = [name for name in abc.catalogue() if root and abc.mesh_path(name, root).is_file()][:most]
    found = []
    for what, names in {"ABC shapes": real, "built-in parts": list(BUILTINS)[:most]}.items():
        if names:
            found += compared(f"signs at {points} points of {len(names)} {what}", names, root, points)
    return found


def compared(what: str, names: Sequence[str], root: str, points: int) -> list[Row]:
    """Rows of one catalogue: wrong signs of every way, all shapes together and the worst one."""
    wrong: dict[str, list[int]] = {way: [] for way in WAYS}
    for name in names:
        shape = load(name, labels="none", segmented=False, abc_root=root, abc_missing="error")
        cloud = Cloud.of(shape.mesh, count=30_000, seed=0)
        pool = draw_pool(cloud, count=points, near_share=0.5, seed=0)
        inside = is_inside(cloud.normalisation.forward(shape.mesh.vertices), shape.mesh.faces, pool)
        for way, seen_as in WAYS.items():
            signed = network_distance(seen_as(shape), cloud.normalisation).signed(pool)
            wrong[way].append(int(((signed < 0) != inside).sum()))
    total, found = points * len(names), []
    for way, counts in wrong.items():
        found.append(Row(what, f"wrong by {way}", sum(counts), total, "points", sum(counts) / total))
        found.append(Row(what, f"wrong by {way}, worst shape", max(counts), points, "points", max(counts) / points))
    return found


def is_inside(vertices: Float[ndarray, "v 3"], faces: ndarray, points: Float[ndarray, "n 3"]) -> Bool[ndarray, " n"]:
    """Whether each point is inside by the exact winding number."""
    exact = igl.winding_number(np.ascontiguousarray(vertices), np.ascontiguousarray(faces, dtype=np.int64), points)
    return np.asarray(exact > INSIDE)
