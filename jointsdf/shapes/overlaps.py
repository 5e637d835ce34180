"""Whether closed bodies overlap, and what a mesh encloses: edges as rays, winding numbers."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from jointsdf.geometry.piercings import find_piercings
from jointsdf.geometry.sampling import sample_by_area
from jointsdf.geometry.topology import edge_components
from jointsdf.geometry.winding import INSIDE, WindingNumber

SAMPLES = 1000  # points of the surface whose sides are examined
LIFT = 2e-6  # of these from the surface, of the longest side
SUSPECT = 0.001  # share of them from which a surface folds; fewer are edges and corners
CLEARLY = 0.7  # winding number of a point that is inside beyond doubt: at most so beneath sheets, 0.5 beneath flat ones
DEEP = 1e-3  # of the longest side: bodies that pass through each other by less are within tessellation's tolerance


@dataclass(frozen=True)
class Sides:
    """Shares of a mesh's surface by the winding numbers just above and beneath it.

    Attributes:
        wrong: Of which not the one side is outside and the other one inside.
        enclosing: That has inside just beneath it, beyond doubt.
    """

    wrong: float
    enclosing: float


def examine_sides(vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"], areas: Float[ndarray, " f"]) -> Sides:
    """Measure the winding number on both sides of the surface, at points uniform by area, the same in every run.

    Args:
        vertices: Positions.
        faces: Vertex indices, counter-clockwise seen from outside.
        areas: Of the faces.
    """
    points, chosen = sample_by_area(vertices, faces, areas, SAMPLES, np.random.default_rng(0))
    a, b, c = vertices[faces[chosen].T]
    normals = np.cross(b - a, c - a)
    lift = LIFT * np.ptp(vertices, axis=0).max() * normals / np.linalg.norm(normals, axis=1, keepdims=True)
    above, beneath = WindingNumber(vertices, faces).at(np.concatenate([points + lift, points - lift])).reshape(2, -1)
    wrong = (above > INSIDE) | (above < -INSIDE) | (beneath < INSIDE)
    return Sides(float(wrong.mean()), float((beneath > CLEARLY).mean()))


def is_folded(vertices: Float[ndarray, "v 3"], faces: Int[ndarray, "f 3"], sides: Sides) -> bool:
    """Whether closed faces overlap, so that the closest face does not tell the side of a point.

    Samples settle it for one body. Of several, thin ones that cross may have too little surface to be sampled.
    """
    if sides.wrong > SUSPECT or edge_components(faces).max() == 0:
        return sides.wrong > SUSPECT
    return bool((find_piercings(vertices, faces).depth > DEEP).any())
