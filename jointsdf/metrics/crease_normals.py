"""Normal consistency beside creases."""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from jointsdf.errors import require_number
from jointsdf.geometry.mesh import face_normals
from jointsdf.metrics import creases, match_creases, project
from jointsdf.values import SurfaceSamples

TIE = 1e-6  # by which distances may differ that are equal but for rounding


@dataclass(frozen=True)
class CreaseNormals:
    """Agreement of the normals within 1% of a crease, `crease_nc`: a chamfer has 0.71 where an edge of a cube has 1.

        crease_nc = (mean over P of abs(n . n_G(p)) + mean over G of abs(n . n_P(g))) / 2

    P and G: samples of prediction and truth that lie within `width` of a true crease. n_G(p): normal of the true face
    closest to p, not of the nearest sample as in `nc`, which may lie across the edge; where p is closest to a crease
    itself, the better of both sides. So a mesh against itself scores 1: that is the floor. Blind to flipped normals.
    NaN where the truth has no crease or no sample is near one, and for an empty prediction.

    Args:
        width: In the frame of the samples, where the longest side is 1.

    Raises:
        InputError: A width below 0.
    """

    width: float = 0.01

    def __post_init__(self) -> None:
        """Check the width."""
        require_number("evaluation crease_normals.width", self.width, 0)

    @property
    def ceilings(self) -> tuple[str, ...]:
        """The score: what grid and extraction alone cost."""
        return ("crease_nc",)

    def __call__(self, predicted: SurfaceSamples, truth: SurfaceSamples) -> dict[str, float]:
        """Score the prediction; see the class."""
        if len(predicted.points) == 0:
            return {"crease_nc": math.nan}
        sides = (predicted, truth), (truth, predicted)
        near = [match_creases(samples, truth)[0] < self.width for samples, _ in sides]
        if not all(chosen.any() for chosen in near):
            return {"crease_nc": math.nan}
        means = [_agreements(*pair)[chosen].mean() for pair, chosen in zip(sides, near, strict=True)]
        return {"crease_nc": float(np.mean(means))}


def _agreements(samples: SurfaceSamples, onto: SurfaceSamples) -> Float[ndarray, " n"]:
    """Cosine between the normal of each sample and that of the closest face of the other mesh, without sign.

    A sample whose closest point is on a crease has two closest faces; it is compared with the better side.
    """
    found = project(samples, onto)
    normals = face_normals(onto.mesh.vertices.astype(np.float64), onto.mesh.faces[found.faces])
    agreements: Float[ndarray, " n"] = np.abs(np.einsum("nd,nd->n", samples.normals, normals))
    distances, nearest = match_creases(samples, onto)
    on_crease = np.flatnonzero(distances <= found.distances * (1 + TIE) + TIE)
    sides = creases(onto).normals[nearest[on_crease]]
    agreements[on_crease] = np.abs(np.einsum("nd,nsd->ns", samples.normals[on_crease], sides)).max(axis=1)
    return agreements
