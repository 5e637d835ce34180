"""Evaluation protocols: sample each surface once per protocol, and run every metric on the same samples."""

import dataclasses
import math
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from jointsdf.errors import InputError
from jointsdf.geometry.caching import cached_by_identity
from jointsdf.geometry.mesh import face_areas, face_normals
from jointsdf.geometry.sampling import sample_by_area
from jointsdf.metrics import Metric
from jointsdf.metrics.distance import Distance
from jointsdf.values import UNMOVED, LabelledMesh, Normalisation, SurfaceSamples

# Fixed seeds: all runs of a shape are compared with the same ground truth samples. The floor is sampled with the
# prediction's seed, so that a perfect prediction scores exactly its floor.
TRUTH_SEED = 1_000_001
PREDICTED_SEED = 1_000_002

_areas = cached_by_identity(face_areas)

FRAMES = ("truth", "own")
Scores = dict[str, dict[str, float]]  # protocol -> column -> value


@dataclass(frozen=True)
class Protocol:
    """Protocol of a comparison of two meshes.

    Args:
        name: Name of the scores' block in a row.
        points: Area-uniform samples on each mesh.
        frame: Which bounding box is centred and scaled to longest side 1: "truth", the ground truth's, for both meshes;
            "own", each mesh's own (as in FlatCAD's published numbers; hides errors of scale and position).
        metrics: Metrics by any name; all run on the same samples.
        field: Measures of the field itself by any name, in the ground truth's frame.

    Raises:
        InputError: An unknown frame, or fewer than 1 point.
    """

    name: str
    points: int
    frame: str
    metrics: Mapping[str, Metric]
    field: Mapping[str, Distance] = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check frame and number of points."""
        if self.frame not in FRAMES:
            raise InputError(f"evaluation frame={self.frame!r}: use one of {', '.join(FRAMES)}")
        if self.points < 1:
            raise InputError(f"evaluation points={self.points}: use a number above 0")


@dataclass(frozen=True)
class GroundTruth:
    """Ground truth of a comparison, sampled once per protocol for all predictions.

    Args:
        mesh: File frame.
        protocols: By name.
    """

    mesh: LabelledMesh
    protocols: Mapping[str, Protocol]

    @cached_property
    def samples(self) -> dict[str, SurfaceSamples]:
        """Samples of the true mesh, by protocol."""
        return {name: self._sample(protocol, self.mesh, TRUTH_SEED) for name, protocol in self.protocols.items()}

    def scores(self, predicted: LabelledMesh) -> Scores:
        """Score a prediction by every metric of every protocol.

        Args:
            predicted: The reconstruction, file frame. May be empty.

        Returns:
            Protocol -> column -> value.

        Raises:
            InputError: Two metrics of a protocol write the same column.
        """
        return self._by_protocol(lambda name: self._scores(name, predicted))

    def references(self, ceiling: LabelledMesh | None) -> Scores:
        """Reference scores of every protocol, independent of a prediction: `<key>_floor` and `<key>_ceiling`.

        The reference of a count `<key>_pred` is `<key>_ceiling`, beside `<key>_gt`.

        The floor is the score of the ground truth against itself, sampled twice; the ceiling that of `ceiling`.

        Args:
            ceiling: The mesh of the exact distance on the prediction's grid with the closest true labels, file frame;
                it has the errors of grid and face rule alone. None makes every `<key>_ceiling` NaN.

        Returns:
            Protocol -> column -> value.
        """
        return self._by_protocol(
            lambda name: self._references(name, "floor", self.mesh) | self._references(name, "ceiling", ceiling)
        )

    def _by_protocol(self, scores: Callable[[str], dict[str, float]]) -> Scores:
        """Evaluate all protocols in parallel threads: sorting, gathering and trees each use one core."""
        _ = self.samples  # here, not in two threads at once
        with ThreadPoolExecutor() as pool:
            return dict(zip(self.protocols, pool.map(scores, self.protocols), strict=True))

    def _scores(self, protocol: str, predicted: LabelledMesh) -> dict[str, float]:
        found = self._sample(self.protocols[protocol], predicted, PREDICTED_SEED)
        scores: dict[str, float] = {}
        for name, metric in self.protocols[protocol].metrics.items():
            columns = metric(found, self.samples[protocol])
            repeated = sorted(scores.keys() & columns.keys())
            if repeated:
                raise InputError(f"evaluation metric {name!r} repeats the column {repeated[0]!r}: keep one of the two")
            scores |= columns
        return scores

    def _references(self, protocol: str, kind: str, mesh: LabelledMesh | None) -> dict[str, float]:
        """Scores of a mesh in the columns that the metrics name in `<kind>s`; NaN without a mesh."""
        samples = None if mesh is None else self._sample(self.protocols[protocol], mesh, PREDICTED_SEED)
        columns: dict[str, float] = {}
        for metric in self.protocols[protocol].metrics.values():
            keys: tuple[str, ...] = getattr(metric, f"{kind}s", ())
            if keys:
                nothing = dict.fromkeys(keys, math.nan)
                values = nothing if samples is None else metric(samples, self.samples[protocol])
                columns |= {f"{key.removesuffix('_pred')}_{kind}": values[key] for key in keys}
        return columns

    def _sample(self, protocol: Protocol, mesh: LabelledMesh, seed: int) -> SurfaceSamples:
        frame = bounding_frame(self.mesh if protocol.frame == "truth" else mesh)
        return sample_surface(mesh, protocol.points, seed, frame)


def bounding_frame(mesh: LabelledMesh) -> Normalisation:
    """Map to the frame in which the mesh's bounding box is centred with longest side 1; identity without faces."""
    if mesh.is_empty:
        return UNMOVED
    used = np.zeros(len(mesh.vertices), dtype=bool)
    used[mesh.faces] = True
    corners = mesh.vertices[used].astype(np.float64)
    low, high = corners.min(axis=0), corners.max(axis=0)
    return Normalisation((low + high) / 2, float((high - low).max()) or 1.0)


def sample_surface(mesh: LabelledMesh, count: int, seed: int, frame: Normalisation = UNMOVED) -> SurfaceSamples:
    """Draw area-uniform points on a mesh, deterministic in the arguments.

    Args:
        mesh: File frame.
        count: Number of points. A mesh without any area gets none.
        seed: Of the draw.
        frame: File frame -> frame of the points.
    """
    nothing = SurfaceSamples(mesh, np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, dtype=np.int64), frame)
    if mesh.is_empty:
        return nothing
    points, faces = sample_by_area(mesh.vertices, mesh.faces, _areas(mesh), count, np.random.default_rng(seed))
    normals = face_normals(mesh.vertices.astype(np.float64), mesh.faces[faces])
    return SurfaceSamples(mesh, frame.forward(points), normals, faces, frame) if normals.any() else nothing
