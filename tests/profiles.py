"""Sheets whose cross-section is a given polygon: creases of known angles."""

from collections.abc import Sequence

import numpy as np

from jointsdf.values import LabelledMesh


def sheet(profile: Sequence[Sequence[float]] | np.ndarray, length: float = 1.0) -> LabelledMesh:
    """The polygon (x, z) moved along y: an open mesh, a rectangle per side, its label the side's number."""
    places = np.asarray(profile, dtype=float)
    x, z = np.repeat(places, 2, axis=0).T
    y = np.tile([0.0, length], len(places))
    first = 2 * np.arange(len(places) - 1)[:, None]
    faces = np.concatenate([first + np.array(face) for face in ([0, 2, 1], [2, 3, 1])], axis=1).reshape(-1, 3)
    return LabelledMesh(np.stack([x, y, z], axis=1), faces, np.repeat(np.arange(len(places) - 1), 2))


def hinge(degrees: float, arm: float = 1.0, length: float = 1.0) -> LabelledMesh:
    """Two rectangles, the second turned by an angle against the first; the crease is the y axis."""
    angle = np.radians(degrees)
    return sheet([(-arm, 0), (0, 0), (arm * np.cos(angle), arm * np.sin(angle))], length)


def fillet(radius: float, facets: int, arm: float = 1.0) -> LabelledMesh:
    """A quarter of a cylinder of some facets between two rectangles at a right angle, tangent to both."""
    angles = np.linspace(0, np.pi / 2, facets + 1)
    bend = np.stack([radius * np.sin(angles), radius * (1 - np.cos(angles))], axis=1)
    return sheet([(-arm, 0), *bend, (radius, radius + arm)])
