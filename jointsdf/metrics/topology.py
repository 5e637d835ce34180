"""Pieces, holes and volume of both meshes."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from jointsdf.surfaces import edge_keys
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
        return topology(predicted.mesh) | {f"{key}_gt": value for key, value in topology(truth.mesh).items()}


def topology(mesh: LabelledMesh) -> dict[str, float]:
    """Components, Euler characteristic and signed volume of one mesh. Vertices that no face uses do not count."""
    if mesh.is_empty:
        return {"components": 0.0, "euler": 0.0, "volume": 0.0}
    used = np.zeros(len(mesh.vertices), dtype=bool)
    used[mesh.faces] = True
    count = int(used.sum())
    faces = (np.cumsum(used) - 1)[mesh.faces]
    keys = np.sort(edge_keys(faces, count))
    edges = keys[np.append(True, keys[1:] != keys[:-1])]
    first, second = np.divmod(edges, count)
    graph = coo_array((np.ones(len(edges)), (first, second)), shape=(count, count))
    components, _ = connected_components(graph, directed=False)
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    volume = np.einsum("ij,ij->", a, np.cross(b, c)) / 6
    return {
        "components": float(components),
        "euler": float(count - len(edges) + len(faces)),
        "volume": volume.item(),
    }
