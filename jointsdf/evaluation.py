"""Scores of a reconstruction: samples both surfaces once per protocol, and runs every metric on the same samples."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from jointsdf.metrics import Metric
from jointsdf.sampling import area_uniform, face_normals
from jointsdf.values import InputError, LabelledMesh, Normalisation, SurfaceSamples

# Evaluation has seeds of its own, so that all heads and seeds of a shape meet the same ground truth samples. The floor
# is sampled like a prediction: a perfect prediction scores exactly its floor.
TRUTH_SEED = 1_000_001
PREDICTED_SEED = 1_000_002

FRAMES = ("truth", "own")


@dataclass(frozen=True)
class Protocol:
    """How two meshes are compared.

    Args:
        name: Names the rows that it makes.
        points: Area-uniform samples on each mesh.
        frame: Which bounding box is centred and scaled to longest side 1: "truth", the ground truth's, for both meshes;
            "own", each mesh's own (FlatCAD's published numbers: hides errors of scale and place).
        metrics: Metrics by a name of the reader's choice; all run on the same samples.

    Raises:
        InputError: An unknown frame, or fewer than 1 point.
    """

    name: str
    points: int
    frame: str
    metrics: Mapping[str, Metric]

    def __post_init__(self) -> None:
        """Check what a user can set."""
        if self.frame not in FRAMES:
            raise InputError(f"evaluation frame={self.frame!r}: use one of {', '.join(FRAMES)}")
        if self.points < 1:
            raise InputError(f"evaluation points={self.points}: use a number above 0")


def evaluate(
    predicted: LabelledMesh,
    truth: LabelledMesh,
    ceiling: LabelledMesh | None,
    protocols: Mapping[str, Protocol],
) -> dict[str, dict[str, float]]:
    """Score a prediction by every protocol.

    Args:
        predicted: The reconstruction, file frame. May be empty.
        truth: The ground truth, file frame.
        ceiling: The mesh of the exact distance on the prediction's grid with the closest true labels, file frame: what
            grid and face rule alone cost. None leaves every `<key>_ceiling` NaN.
        protocols: Ways to compare, by name.

    Returns:
        Per protocol: every metric, `<key>_floor` (the ground truth against itself, sampled twice) and `<key>_ceiling`.

    Raises:
        InputError: Two metrics of a protocol write the same column.
    """
    return {name: _scores(protocol, predicted, truth, ceiling) for name, protocol in protocols.items()}


def _scores(
    protocol: Protocol, predicted: LabelledMesh, truth: LabelledMesh, ceiling: LabelledMesh | None
) -> dict[str, float]:
    true = _framed_samples(protocol, truth, truth, TRUTH_SEED)
    found = _framed_samples(protocol, predicted, truth, PREDICTED_SEED)
    again = _framed_samples(protocol, truth, truth, PREDICTED_SEED)
    best = _framed_samples(protocol, ceiling, truth, PREDICTED_SEED) if ceiling is not None else None
    scores: dict[str, float] = {}
    for name, metric in protocol.metrics.items():
        columns = metric(found, true)
        columns |= _companions(metric, "floor", again, true) | _companions(metric, "ceiling", best, true)
        repeated = sorted(scores.keys() & columns.keys())
        if repeated:
            raise InputError(f"evaluation metric {name!r} repeats the column {repeated[0]!r}: keep one of the two")
        scores |= columns
    return scores


def _companions(metric: Metric, kind: str, samples: SurfaceSamples | None, truth: SurfaceSamples) -> dict[str, float]:
    """The columns `<key>_<kind>` that the metric asks for, NaN without samples to measure."""
    keys: tuple[str, ...] = getattr(metric, f"{kind}s", ())
    if not keys:
        return {}
    values = metric(samples, truth) if samples is not None else dict.fromkeys(keys, math.nan)
    return {f"{key}_{kind}": values[key] for key in keys}


def _framed_samples(protocol: Protocol, mesh: LabelledMesh, truth: LabelledMesh, seed: int) -> SurfaceSamples:
    frame = bounding_frame(truth if protocol.frame == "truth" else mesh)
    framed = LabelledMesh(frame.forward(mesh.vertices.astype(np.float64)), mesh.faces.astype(np.int64), mesh.labels)
    return sample_surface(framed, protocol.points, seed)


def bounding_frame(mesh: LabelledMesh) -> Normalisation:
    """The map to the frame where the mesh's bounding box is centred, its longest side 1; identity without faces."""
    if mesh.is_empty:
        return Normalisation(np.zeros(3), 1.0)
    corners = mesh.vertices[mesh.faces].reshape(-1, 3).astype(np.float64)
    low, high = corners.min(axis=0), corners.max(axis=0)
    return Normalisation((low + high) / 2, float((high - low).max()) or 1.0)


def sample_surface(mesh: LabelledMesh, count: int, seed: int) -> SurfaceSamples:
    """Draw area-uniform points on a mesh, a function of the arguments alone.

    Args:
        mesh: Any frame; the points are in the same.
        count: Number of points. A mesh without any area gets none.
        seed: Of the draw.
    """
    normals = face_normals(mesh.vertices, mesh.faces)
    if not normals.any():
        return SurfaceSamples(mesh, np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, dtype=np.int64))
    points, faces = area_uniform(mesh.vertices, mesh.faces, count, np.random.default_rng(seed))
    return SurfaceSamples(mesh, points, normals[faces], faces)
