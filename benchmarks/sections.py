"""The zero level set of a field in the section across a crease: where it is, and over what length it turns."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

LOOKED = 0.01  # longest side 1: how far the zero level set is looked for, and followed to each side
INTERVALS = 40  # of the search for a change of sign
HALVINGS = 14
STEP = 0.00005  # along the zero level set

Differential = Callable[[Float[ndarray, "n 3"]], tuple[Float[ndarray, " n"], Float[ndarray, "n 3"]]]


def gaps(
    sdf: Callable[[Float[ndarray, "n 3"]], Float[ndarray, " n"]],
    points: Float[ndarray, "n 3"],
    directions: Float[ndarray, "n 3"],
) -> Float[ndarray, " n"]:
    """Signed distance along unit vectors from points to the nearest zero of a field, by bisection; NaN without one.

    Only zeros where the field rises along the vector count.
    """
    at = np.linspace(-LOOKED, LOOKED, INTERVALS + 1)
    places = points[:, None] + at[:, None] * directions[:, None]
    values = sdf(places.reshape(-1, 3)).reshape(len(points), len(at))
    rising = (values[:, :-1] <= 0) & (values[:, 1:] > 0)
    middles = (at[:-1] + at[1:]) / 2
    nearest = np.where(rising, np.abs(middles), np.inf).argmin(axis=1)
    low, high = at[nearest], at[nearest + 1]
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        outside = sdf(points + middle[:, None] * directions) > 0
        low, high = np.where(outside, low, middle), np.where(outside, middle, high)
    return np.where(rising.any(axis=1), (low + high) / 2, np.nan)


def radii(
    differential: Differential,
    starts: Float[ndarray, "n 3"],
    bisectors: Float[ndarray, "n 3"],
    across: Float[ndarray, "n 3"],
    angles: Float[ndarray, " n"],
    convex: Bool[ndarray, " n"],
) -> Float[ndarray, " n"]:
    """Radius of the turn of a zero level set in planes: arc length of the middle half of an angle, by that half.

    Args:
        differential: Points -> signed distances and gradients.
        starts: Points of the zero level set.
        bisectors: Unit vectors towards which the normal is in the middle of its turn.
        across: Perpendicular unit vectors, which span the planes with them.
        angles: Of the whole turn, radians.
        convex: Whether the normal turns towards `across` on the way along it, else away from it.

    Returns:
        The radii; infinite where the normal does not turn that far within `LOOKED`.
    """
    behind, ahead = (_turns(differential, starts, bisectors, across, sign) for sign in (-1.0, 1.0))
    scale = np.where(convex, 4, -4) / angles
    turns = np.concatenate([behind[:, :0:-1], ahead], axis=1) * scale[:, None]
    middle = behind.shape[1] - 1
    crossing = (turns[:, :-1] <= 0) & (turns[:, 1:] > 0)
    places = np.arange(turns.shape[1] - 1)
    nearest = np.where(crossing, np.abs(places + 0.5 - middle), np.inf).argmin(axis=1)
    left = _first(-turns[:, ::-1], turns.shape[1] - 1 - nearest)
    right = _first(turns, nearest + 1)
    length = STEP * (left + right - (turns.shape[1] - 1))
    return np.where(crossing.any(axis=1), length / (angles / 2), np.inf)


def _turns(
    differential: Differential,
    starts: Float[ndarray, "n 3"],
    bisectors: Float[ndarray, "n 3"],
    across: Float[ndarray, "n 3"],
    sign: float,
) -> Float[ndarray, "n s"]:
    """Angle of the normal from the bisector towards `across`, every `STEP` from the start on; Newton's correction."""
    points, found = starts, []
    for _ in range(round(LOOKED / STEP) + 1):
        values, gradients = differential(points)
        up, side = (np.einsum("nd,nd->n", gradients, axis) for axis in (bisectors, across))
        size = np.maximum(np.hypot(up, side), 1e-6)
        found.append(np.arctan2(side, up))
        normals = (up[:, None] * bisectors + side[:, None] * across) / size[:, None]
        tangents = (up[:, None] * across - side[:, None] * bisectors) / size[:, None]
        correction = np.clip(values / size, -STEP, STEP)
        points = points - correction[:, None] * normals + sign * STEP * tangents
    return np.stack(found, axis=1)


def _first(turns: Float[ndarray, "n s"], begin: Int[ndarray, " n"]) -> Float[ndarray, " n"]:
    """Place, in steps and interpolated, at which each row first reaches 1 from an index on; infinite if nowhere."""
    later = np.arange(turns.shape[1]) >= begin[:, None]
    reached = (turns >= 1) & later
    index = np.maximum(reached.argmax(axis=1), 1)
    rows = np.arange(len(turns))
    before, after = turns[rows, index - 1], turns[rows, index]
    share = np.clip((1 - before) / np.where(after == before, 1, after - before), 0, 1)
    return np.where(reached.any(axis=1), index - 1 + share, np.inf)
