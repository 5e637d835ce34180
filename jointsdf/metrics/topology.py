"""Pieces, holes and volume of both meshes."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from jointsdf.geometry.mesh import edge_ends
from jointsdf.metrics import remembered
from jointsdf.values import LabelledMesh, SurfaceSamples


@dataclass(frozen=True)
class Topology:
    """`components`, `euler` and `volume` of the prediction, and the same of the ground truth with `_gt` appended.

    A component is a set of faces connected through shared vertices. euler = vertices - edges + faces. The volume is
    signed (positive where faces are counter-clockwise from outside), in cubic units of the frame of the samples, and
    means something on closed meshes only. All 0 for an empty mesh.
    """

    def __call__(self, predicted: SurfaceSamples, truth: SurfaceSamples) -> dict[str, float]:
        """Count and measure both meshes; see the class."""
        return _in_frame(predicted) | {f"{key}_gt": value for key, value in _in_frame(truth).items()}


def _in_frame(samples: SurfaceSamples) -> dict[str, float]:
    found = topology(samples.mesh)
    return found | {"volume": found["volume"] / samples.frame.scale**3}


@remembered
def topology(mesh: LabelledMesh) -> dict[str, float]:
    """Components, Euler characteristic and signed volume of one mesh. Vertices that no face uses do not count."""
    if mesh.is_empty:
        return {"components": 0.0, "euler": 0.0, "volume": 0.0}
    used = np.zeros(len(mesh.vertices), dtype=bool)
    used[mesh.faces] = True
    count = int(used.sum())
    faces = (np.cumsum(used) - 1)[mesh.faces]
    edges = coo_array((np.ones(faces.size), edge_ends(faces)), shape=(count, count)).tocsr()  # each once
    components, _ = connected_components(edges, directed=False)
    vertices = mesh.vertices[used].astype(np.float64)
    a, b, c = (vertices - vertices.mean(axis=0))[faces.T]
    volume = np.einsum("ij,ij->", a, np.cross(b, c)) / 6
    return {
        "components": float(components),
        "euler": float(count - edges.nnz + len(faces)),
        "volume": volume.item(),
    }
