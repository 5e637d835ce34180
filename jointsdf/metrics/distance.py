"""Distance away from the surface: values, gradients and signs of a field against the true mesh's exact distance."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import igl
import numpy as np
from jaxtyping import Float
from numpy import ndarray

from jointsdf.errors import require_integer
from jointsdf.geometry.distance import ExactDistance
from jointsdf.geometry.mesh import face_normals
from jointsdf.geometry.sampling import sample_by_area

SEED = 1_000_003
BANDS = {"": math.inf, "_b01": 0.001, "_b1": 0.01, "_b5": 0.05}  # suffix of the columns: largest |d|
FAR = 0.02  # |d| from which a relative error counts, at uniform points
NEAR_SHARE = 0.1  # the same in a band, as a share of it
EXCESS, SLACK = 1.02, 0.001  # a value beyond EXCESS |d| + SLACK lets a sphere tracer pass through the surface
DRAWS = 1.5  # points drawn for each one wanted in a band: along a crease a normal does not lead straight away

COLUMNS = (
    "sdf_error_mean", "sdf_error_p99", "sdf_relative_mean", "sdf_relative_p99", "sdf_ratio", "eikonal_error",
    "gradient_angle_median", "gradient_angle_p95", "overshoot", "sign_error",
)  # fmt: skip

# Signed distance and its gradient at points; everything in the unit frame.
UnitField = Callable[[Float[ndarray, "n 3"]], tuple[Float[ndarray, " n"], Float[ndarray, "n 3"]]]


class Probes(NamedTuple):
    """Points with the exact distance of the true mesh, unit frame.

    Attributes:
        points: Positions.
        distances: Signed, negative inside.
        directions: Unit gradient of the distance; 0 at points of the surface, whose closest point tells none.
    """

    points: Float[ndarray, "n 3"]
    distances: Float[ndarray, " n"]
    directions: Float[ndarray, "n 3"]


@dataclass(frozen=True)
class Distance:
    """Errors of a field as a signed distance, at uniform points of the training box and in bands about the surface.

    Lengths in the unit frame (longest side 1), angles in degrees. In a band b, points of the surface are moved along
    its normal by U(-b, b), and those nearer than b to it are kept. Columns of the box, and with a suffix of each band:

        sdf_error_mean, _p99              |f - d|
        sdf_relative_mean, _p99           |f - d| / |d|, where |d| > 0.02, in a band > b / 10
        sdf_ratio                         median of f / d there
        eikonal_error                     mean of | ||grad f|| - 1 |
        gradient_angle_median, _p95       between grad f and the exact gradient
        overshoot                         share of points where |f| > 1.02 |d| + 0.001
        sign_error                        share of points with the wrong sign

    Args:
        points: In the box, and in each band.

    Raises:
        InputError: Fewer than 1 point.
    """

    points: int = 20_000

    def __post_init__(self) -> None:
        """Check the number of points."""
        require_integer("evaluation distance.points", self.points, 1)

    def __call__(self, field: UnitField, exact: ExactDistance, box: Float[ndarray, "2 3"]) -> dict[str, float]:
        """Score a field.

        Args:
            field: The field.
            exact: Distance to the true mesh.
            box: Lowest and highest corner of the training box.
        """
        generator = np.random.default_rng(SEED)
        scores: dict[str, float] = {}
        for suffix, width in BANDS.items():
            uniform = math.isinf(width)
            points = (
                generator.uniform(box[0], box[1], (self.points, 3)) if uniform else self._near(exact, width, generator)
            )
            probes = find_probes(exact, points)
            found = score_field(*field(points), probes, beyond=FAR if uniform else NEAR_SHARE * width)
            scores |= {f"{name}{suffix}": value for name, value in found.items()}
        return scores

    def _near(self, exact: ExactDistance, width: float, generator: np.random.Generator) -> Float[ndarray, "n 3"]:
        """Points nearer to the surface than a width: uniform ones of the surface, moved along its normal."""
        vertices, faces = exact.closest.vertices, exact.closest.faces
        count = math.ceil(DRAWS * self.points)
        points, chosen = sample_by_area(vertices, faces, igl.doublearea(vertices, faces), count, generator)
        moved = points + generator.uniform(-width, width, (count, 1)) * face_normals(vertices, faces[chosen])
        kept: Float[ndarray, "n 3"] = moved[exact.closest.query(moved)[0] < width][: self.points]
        return kept


def find_probes(exact: ExactDistance, points: Float[ndarray, "n 3"]) -> Probes:
    """Find the exact distance and its gradient at points of the frame of the exact distance's mesh."""
    distances = exact.signed(points)
    return Probes(points, distances, exact.gradients(points, distances))


def score_field(
    values: Float[ndarray, " n"], gradients: Float[ndarray, "n 3"], probes: Probes, beyond: float
) -> dict[str, float]:
    """Columns of one set of points, see `Distance`; NaN for those that no point tells.

    Args:
        values: Of the field at the probes.
        gradients: Of the field there.
        probes: The truth.
        beyond: |d| from which a relative error counts.
    """
    known = np.abs(probes.distances)
    errors, far = np.abs(values - probes.distances), known > beyond
    lengths = np.linalg.norm(gradients, axis=1)
    cosines = np.einsum("ij,ij->i", gradients, probes.directions) / np.maximum(lengths, np.finfo(float).tiny)
    angles = np.degrees(np.arccos(np.clip(cosines[probes.directions.any(axis=1)], -1, 1)))
    relative = errors[far] / known[far]
    scores = (
        *(_mean(errors), _percentile(errors, 99), _mean(relative), _percentile(relative, 99)),
        _percentile(values[far] / probes.distances[far], 50),
        _mean(np.abs(lengths - 1)),
        *(_percentile(angles, 50), _percentile(angles, 95)),
        _mean(np.abs(values) > EXCESS * known + SLACK),
        _mean((values < 0) != (probes.distances < 0)),
    )
    return dict(zip(COLUMNS, scores, strict=True))


def _mean(values: ndarray) -> float:
    return float(values.mean()) if len(values) else math.nan


def _percentile(values: ndarray, share: int) -> float:
    return float(np.percentile(values, share)) if len(values) else math.nan
