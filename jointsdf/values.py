"""Every value handed from one stage to the next; read this file first.

Frames: *file* is the mesh file's own units; *network* is the training box, centred on the training cloud's mean and
divided by its largest absolute coordinate; *unit* is the evaluation box, longest side 1. Every length names its frame.
"""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Float, Int, UInt8
from numpy import ndarray
from scipy.spatial import KDTree
from torch import Tensor

UNLABELLED = -1
MOST_LABEL = 2**31 - 1  # largest part id: mesh.ply stores 32-bit integers
BOX = 1.1  # half side of the training box in the network frame (paper: samples in [-1.1, 1.1]^3)


@dataclass(frozen=True)
class Normalisation:
    """Invertible map from the file frame to another: `(file - centre) / scale`.

    Attributes:
        centre: Origin of the other frame, file units.
        scale: File units per unit of the other frame, > 0.

    >>> to_network = Normalisation(np.array([5.0, 0.0, 0.0]), 2.0)
    >>> to_network.forward(np.array([[7.0, 0.0, 4.0]])).tolist()
    [[1.0, 0.0, 2.0]]
    """

    centre: Float[ndarray, "3"]
    scale: float

    def forward(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
        """Map points of the file frame to the other frame."""
        return (points - self.centre) / self.scale

    def inverse(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
        """Map points of the other frame to the file frame."""
        return points * self.scale + self.centre


UNMOVED = Normalisation(np.zeros(3), 1.0)  # the file frame itself


@dataclass(frozen=True)
class Unit:
    """A length unit of the file frame.

    Attributes:
        name: Symbol, e.g. `mm`.
        metres: Metres per unit.
        known: Whether the file or the user says it; otherwise it is the assumed millimetre.
    """

    name: str
    metres: float
    known: bool = True


ASSUMED_UNIT = Unit("mm", 1e-3, known=False)  # what CAD programs write into files that name no unit


@dataclass(frozen=True)
class LabelledMesh:
    """A triangle mesh with one part label per face. Never modified in place.

    Attributes:
        vertices: Positions; file frame unless the variable's name states another.
        faces: Vertex indices, counter-clockwise seen from outside.
        labels: Original part id of each face, -1 where unlabelled.
    """

    vertices: Float[ndarray, "v 3"]
    faces: Int[ndarray, "f 3"]
    labels: Int[ndarray, " f"]

    @property
    def is_empty(self) -> bool:
        """True if there is no face (a field without zero level set in the box)."""
        return len(self.faces) == 0

    @cached_property
    def part_ids(self) -> Int[ndarray, " k"]:
        """Distinct labels of the faces, ascending, without -1."""
        ids = np.unique(self.labels)
        return ids[ids != UNLABELLED]


@dataclass(frozen=True)
class Shape:
    """One CAD mesh with its part labels, as loaded: the ground truth of a run.

    Attributes:
        name: Catalogue name, or `<stem>-<6 hex digits of the mesh's sha256>` for a path. Names folders and rows.
        mesh: Ground truth in the file frame, original label ids. All labels are -1 where the shape has none.
        mesh_sha256: Hash of the mesh file's bytes (of the generated arrays for a built-in part).
        label_provider: Source of the labels, e.g. `file:labels.npy`, `brep`, `geometric:k=7`, `builtin`, `none`.
        watertight: Whether every edge has exactly two faces; if not, signs come from the winding number.
        flipped: Number of the file's faces whose orientation was reversed.
        dropped: Number of the file's faces left out: repeated, doubled with the opposite winding, or without area.
        unit: Of the file frame.
        folded: Whether watertight faces overlap or fold over, so that signs come from the winding number all the same.
        welded: Number of vertices that were moved to another one, nearly at the same place.
        up: Axis of the file frame that points up: `z` in CAD, `y` in glTF.
    """

    name: str
    mesh: LabelledMesh
    mesh_sha256: str
    label_provider: str
    watertight: bool
    flipped: int = 0
    dropped: int = 0
    unit: Unit = ASSUMED_UNIT
    folded: bool = False
    welded: int = 0
    up: str = "z"

    @property
    def labels_sha256(self) -> str:
        """Hash of the labels, whatever their source."""
        return hash_labels(self.mesh.labels)

    @property
    def part_ids(self) -> Int[ndarray, " k"]:
        """Distinct labels, ascending, without -1."""
        return self.mesh.part_ids

    @property
    def truth(self) -> "Shape":
        """What a fit is scored against: the shape itself."""
        return self


@dataclass(frozen=True)
class Scan:
    """One point cloud with part labels, as loaded: the shape of a run where the points are all that is known.

    Attributes:
        name: `<stem>-<6 hex digits of the file's sha256>`. Names folders and rows.
        points: Positions in the file frame.
        normals: Unit normals, 0 where the file has none.
        labels: Original part ids, -1 where unlabelled.
        points_sha256: Hash of the file's bytes (of the arrays for a cloud in memory).
        label_provider: Source of the labels, e.g. `file:scan.ply`, `none`.
        truth: Mesh of the same part in the same frame, for scores alone; None where nobody has it.
        colours: sRGB of the points, for pictures; None where the file has none.
        unit: Of the file frame.
        up: Axis of the file frame that points up.
    """

    name: str
    points: Float[ndarray, "n 3"]
    normals: Float[ndarray, "n 3"]
    labels: Int[ndarray, " n"]
    points_sha256: str
    label_provider: str
    truth: Shape | None = None
    colours: UInt8[ndarray, "n 3"] | None = None
    unit: Unit = ASSUMED_UNIT
    up: str = "z"

    @property
    def labels_sha256(self) -> str:
        """Hash of the labels, whatever their source."""
        return hash_labels(self.labels)

    @cached_property
    def part_ids(self) -> Int[ndarray, " k"]:
        """Distinct labels, ascending, without -1."""
        ids = np.unique(self.labels)
        return ids[ids != UNLABELLED]

    @cached_property
    def side(self) -> float:
        """Longest side of the points' bounding box, file units."""
        return float(np.ptp(self.points, axis=0).max())


Subject = Shape | Scan  # what a run is fitted to


def hash_labels(labels: Int[ndarray, " n"]) -> str:
    """Hash of labels, the same on every machine."""
    return hashlib.sha256(np.ascontiguousarray(labels, dtype="<i8").tobytes()).hexdigest()


@dataclass(frozen=True)
class SurfaceSamples:
    """Area-uniform points on one surface, for evaluation; all points of a comparison are in one frame.

    Attributes:
        mesh: The surface, file frame, so that results cached for it serve samples in any frame.
        points: Positions.
        normals: Unit normal of each point's face.
        faces: Index of each point's face in `mesh`.
        frame: File frame -> frame of the points.
    """

    mesh: LabelledMesh
    points: Float[ndarray, "n 3"]
    normals: Float[ndarray, "n 3"]
    faces: Int[ndarray, " n"]
    frame: Normalisation = UNMOVED

    @property
    def labels(self) -> Int[ndarray, " n"]:
        """Part label of each point's face."""
        return self.mesh.labels[self.faces]

    @cached_property
    def tree(self) -> KDTree:
        """Nearest-neighbour index of the points, built once for all metrics."""
        return KDTree(self.points)


class LabelledPoints(NamedTuple):
    """Points of the surface with their parts.

    Attributes:
        points: Network frame.
        labels: Class index of each, -1 where unlabelled.
        judges: The last so many are not learned from: they judge what was learned.
    """

    points: Float[ndarray, "n 3"]
    labels: Int[ndarray, " n"]
    judges: int = 0


class Samples(NamedTuple):
    """The points of one training step, a function of (seed, step) alone. Network frame.

    Attributes:
        manifold: Points on the surface.
        labels: Class index 0..K-1 of each manifold point, -1 where unlabelled.
        normals: Unit normal of the surface at each manifold point, 0 where unknown.
        non_manifold: Points uniform in the box.
        shell: Points near the surface.
        angles: Rotation of each shell point's tangent frame about its normal, radians.
        pool: Points of known signed distance.
        pool_distances: Signed distance of the pool points, negative inside.
        far: Points of the pool with known gradient of the distance.
        far_gradients: That gradient, of unit length.
    """

    manifold: Float[Tensor, "m 3"]
    labels: Int[Tensor, " m"]
    normals: Float[Tensor, "m 3"]
    non_manifold: Float[Tensor, "n 3"]
    shell: Float[Tensor, "s 3"]
    angles: Float[Tensor, " s"]
    pool: Float[Tensor, "p 3"]
    pool_distances: Float[Tensor, " p"]
    far: Float[Tensor, "q 3"] = torch.zeros(0, 3)
    far_gradients: Float[Tensor, "q 3"] = torch.zeros(0, 3)


@dataclass(frozen=True)
class FieldValues:
    """Values of the field at one set of points; None for those that no active term needs.

    Attributes:
        sdf: f(x), network length units.
        grad: Gradient of f, dimensionless.
        mixed: u^T H v in a random tangent frame (u, v) per point, 1 / network length.
        logits: Pre-softmax part scores.
        hessian: H of f, symmetric, 1 / network length.
    """

    sdf: Float[Tensor, " n"]
    grad: Float[Tensor, "n 3"] | None = None
    mixed: Float[Tensor, " n"] | None = None
    logits: Float[Tensor, "n k"] | None = None
    hessian: Float[Tensor, "n 3 3"] | None = None


@dataclass(frozen=True)
class Step:
    """Values of one training step by the paper's names of the point sets: the input of every loss term.

    Attributes:
        fields: Field values at each point set that an active term needs: manifold, non_manifold, shell, pool.
        labels: Class index of each manifold point, -1 where unlabelled.
        normals: Unit normal of the surface at each manifold point, 0 where unknown.
        pool_distances: Known signed distance at the pool points, network length units.
        far_gradients: Known gradient of the distance at the far points.
    """

    fields: Mapping[str, FieldValues]
    labels: Int[Tensor, " m"]
    normals: Float[Tensor, "m 3"]
    pool_distances: Float[Tensor, " p"]
    far_gradients: Float[Tensor, "q 3"] = field(default_factory=lambda: torch.zeros(0, 3))
