"""A field with its large matrices rounded to float16, and the error that this makes."""

import copy
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from jointsdf.model.field import JointField
from jointsdf.model.field_file import half_state
from jointsdf.values import BOX

POINTS, SEED = 20_000, 0  # of the measurement
NEWTON_STEPS = 8
ON_SURFACE = 1e-3  # network length units: |f| of a point that counts as on the surface
NEAR = 0.01  # half the width of the band about the surface, network length units


class RoundingError(NamedTuple):
    """Difference of a rounded field from the full one; distances as shares of the shape's longest side.

    Attributes:
        near: Largest difference of the distance within 1% about the surface; NaN for a field without a surface.
        near_p99: Its 99th percentile.
        box: Largest difference at random points of the training box.
        parts: Share of the points near the surface whose part differs.
    """

    near: float
    near_p99: float
    box: float
    parts: float

    def __str__(self) -> str:
        """One line for the log."""
        return (
            f"float16 weights move the distance by at most {self.near:.2g} of the longest side near the surface "
            f"(99%: {self.near_p99:.2g}), {self.box:.2g} in the box; {self.parts:.3%} of the parts differ"
        )


def round_to_half(field: JointField) -> JointField:
    """A copy of the field that computes in float32 with the weights that `JointField.save(half=True)` keeps.

    Raises:
        InputError: A weight beyond the range of float16.
    """
    rounded = copy.deepcopy(field)
    rounded.load_state_dict(half_state(field))
    return rounded


def rounding_error(field: JointField, rounded: JointField) -> RoundingError:
    """Measure the difference of two fields of one shape at random points, the same in every call."""
    random = np.random.default_rng(SEED)
    anywhere = random.uniform(-BOX, BOX, (POINTS, 3))
    surface = _onto_surface(field, anywhere)
    near = surface + random.uniform(-NEAR, NEAR, surface.shape)
    side = float(np.ptp(surface, axis=0).max()) if len(surface) else 2.0
    in_box, parts = _differences(field, rounded, anywhere, side)[0], np.array([np.nan])
    by_surface = np.array([np.nan])
    if len(near):
        by_surface, parts = _differences(field, rounded, near, side)
    return RoundingError(*map(float, (by_surface.max(), np.quantile(by_surface, 0.99), in_box.max(), parts.mean())))


def _onto_surface(field: JointField, points: Float[ndarray, "n 3"]) -> Float[ndarray, "m 3"]:
    """Those of the points that Newton's steps along the gradient take to the zero level set, network frame."""
    for _ in range(NEWTON_STEPS):
        sdf, grad = field.network_differential(points)
        step = (sdf / np.maximum((grad**2).sum(axis=1), 1e-6))[:, None] * grad
        points = np.clip(points - step, -BOX, BOX)
    kept: ndarray = points[np.abs(field.network_sdf(points)) < ON_SURFACE]
    return kept


def _differences(
    field: JointField, rounded: JointField, points: Float[ndarray, "n 3"], side: float
) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"]]:
    """Differences of the distance as shares of the longest side, and 1.0 where the parts differ."""
    distance = np.abs(rounded.network_sdf(points).astype(float) - field.network_sdf(points)) / side
    return distance, (rounded.network_part(points) != field.network_part(points)).astype(float)
