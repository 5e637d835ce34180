"""Segmentation of any mesh by its geometry: agglomerative clustering of smooth regions, cut at any number of parts.

Smooth regions are merged in pairs, the cheapest first. Parts end at concave creases, at holes and where the thickness
changes; convex edges, small regions and enclosed borders bind. Smooth regions are bisected where more parts are wanted.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from jointsdf.errors import InputError
from jointsdf.geometry.face_graph import face_graph, smooth_regions
from jointsdf.geometry.mesh import face_areas
from jointsdf.geometry.topology import components
from jointsdf.shapes.segmentation.bisection import bisect_regions
from jointsdf.shapes.segmentation.merging import APART, SMALLEST, Merging
from jointsdf.shapes.segmentation.region_features import measure_regions
from jointsdf.values import LabelledMesh

LEAVES = 64  # least number of pieces that smooth regions are bisected into
FEWEST, MOST = 2, 18  # parts that are natural
FINENESS = 0.25  # power of the number of parts in the choice of the natural number
NOISE = 0.01  # added to costs, so that those far below it count as equal
DIGITS = 9  # decimals by which numbers are compared, so that machines agree


@dataclass(frozen=True)
class Hierarchy:
    """Nested partitions of a mesh's faces, one for each number of parts.

    Attributes:
        leaves: Finest piece of each face, 0, 1, ...
        areas: Of each piece, share of the whole.
        merges: In their order: the piece that stays, and the one that joins it with all that joined it before.
        costs: Of each merge, ascending.
    """

    leaves: Int[ndarray, " f"]
    areas: Float[ndarray, " l"]
    merges: Int[ndarray, "m 2"]
    costs: Float[ndarray, " m"]

    def cut(self, num_parts: int | None) -> Int[ndarray, " f"]:
        """Part of each face, 0, 1, .. by falling area.

        Args:
            num_parts: Wanted number of parts; None for the natural one.

        Raises:
            InputError: There are not as many pieces.
        """
        num_parts = self.natural_parts if num_parts is None else num_parts
        if not 1 <= num_parts <= len(self.areas):
            raise InputError(f"num_parts={num_parts}: this mesh can be cut into 1 to {len(self.areas)} parts")
        owner = np.arange(len(self.areas))
        for stays, joins in self.merges[: len(self.areas) - num_parts]:
            owner[owner == owner[joins]] = owner[stays]
        ids, parts = np.unique(owner, return_inverse=True)
        area = np.bincount(parts, self.areas, minlength=len(ids)).round(DIGITS)
        rank = np.argsort(np.argsort(-area, kind="stable"), kind="stable")
        labels: Int[ndarray, " f"] = rank[parts][self.leaves]
        return labels

    @property
    def natural_parts(self) -> int:
        """The number of parts, 2 to 18, before the merge with the largest ratio of its cost to the one before.

        A small power of the number itself prefers the finer of two equals.
        """
        most = min(MOST, len(self.areas))
        if most < FEWEST:
            return most
        costs = np.concatenate([[0.0], self.costs]) + NOISE
        jump = np.log(costs[1:] / costs[:-1])[::-1][: most - 1]  # jump[k - 2]: from k to k - 1 parts
        return FEWEST + int(np.argmax((jump * np.arange(FEWEST, most + 1) ** FINENESS).round(DIGITS)))

    def save(self, path: Path) -> None:
        """Write everything to an `.npz` file."""
        np.savez_compressed(path, leaves=self.leaves, areas=self.areas, merges=self.merges, costs=self.costs)

    @classmethod
    def load(cls, path: Path) -> "Hierarchy":
        """Read what `save` wrote."""
        with np.load(path, allow_pickle=False) as arrays:
            return cls(arrays["leaves"], arrays["areas"], arrays["merges"], arrays["costs"])


def build_hierarchy(mesh: LabelledMesh, patches: Int[ndarray, " f"] | None) -> Hierarchy:
    """Build the hierarchy of parts of a mesh; its labels are ignored.

    Every part is connected, unless it holds several bodies because fewer parts than bodies are wanted; no part but a
    whole body is below 0.2% of the area.

    Args:
        mesh: Any frame; open, non-manifold and of several bodies if need be, without degenerate faces.
        patches: B-rep patch of each face, -1 where unknown; None where there are none.
    """
    size = np.linalg.norm(np.ptp(mesh.vertices, axis=0))
    centres = (mesh.vertices[mesh.faces].mean(axis=1) - mesh.vertices.mean(axis=0)) / size
    order = np.lexsort(centres.round(DIGITS).T)  # everything below then breaks ties by place, not by the faces' order
    mesh, centres = LabelledMesh(mesh.vertices, mesh.faces[order], mesh.labels[order]), centres[order]
    graph, areas = face_graph(mesh), face_areas(mesh)
    areas = areas / areas.sum()
    regions = smooth_regions(graph, None if patches is None else patches[order])
    merges, costs, absorbed = Merging(measure_regions(mesh, graph, regions)).run()
    merges, costs = _merge_bodies(merges, costs, areas, centres, regions)
    atoms, merges, costs = _absorb_first(absorbed, merges, costs, regions)
    lengths = np.linalg.norm(centres[graph.pairs[:, 0]] - centres[graph.pairs[:, 1]], axis=1)
    pieces, cuts = bisect_regions(atoms, graph.pairs, lengths, centres, areas, LEAVES, SMALLEST)
    leaves = np.zeros_like(pieces)
    leaves[order] = pieces
    return Hierarchy(
        leaves,
        np.bincount(pieces, areas),
        np.concatenate([cuts[::-1], merges]),
        np.maximum.accumulate(np.concatenate([np.zeros(len(cuts)), costs])),
    )


def _merge_bodies(
    merges: Int[ndarray, "m 2"],
    costs: Float[ndarray, " m"],
    areas: Float[ndarray, " f"],
    centres: Float[ndarray, "f 3"],
    regions: Int[ndarray, " f"],
) -> tuple[Int[ndarray, "n 2"], Float[ndarray, " n"]]:
    """Append merges of bodies that do not touch: the smallest joins the one with the nearest centre."""
    body = components(merges, int(regions.max()) + 1)
    names = np.unique(body, return_index=True)[1]  # the region that stays is the body's lowest: a < b in each merge
    size = np.bincount(body[regions], areas)
    moment = np.stack([np.bincount(body[regions], areas * axis) for axis in centres.T], axis=1)
    joined = []
    alive = np.ones(len(names), dtype=bool)
    for _ in range(len(names) - 1):
        small = int(np.argmin(np.where(alive, size, np.inf)))
        alive[small] = False
        away = np.linalg.norm(moment / size[:, None] - moment[small] / size[small], axis=1)
        near = int(np.argmin(np.where(alive, away, np.inf)))
        size[near] += size[small]
        moment[near] += moment[small]
        joined.append((names[near], names[small]))
    extra = np.array(joined, dtype=np.int64).reshape(-1, 2)
    return np.concatenate([merges, extra]), np.concatenate([costs, np.full(len(extra), APART)])


def _absorb_first(
    absorbed: int, merges: Int[ndarray, "m 2"], costs: Float[ndarray, " m"], regions: Int[ndarray, " f"]
) -> tuple[Int[ndarray, " f"], Int[ndarray, "n 2"], Float[ndarray, " n"]]:
    """Apply the first merges: the renumbered regions, and the other merges in the new numbers."""
    number = components(merges[:absorbed], int(regions.max()) + 1)
    return number[regions], number[merges[absorbed:]], costs[absorbed:]
