"""Greedy agglomerative merging of regions into parts, the cheapest pair first."""

import heapq

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from jointsdf.shapes.segmentation.region_features import RegionFeatures

SMALLEST = 0.002  # share of the area below which a region is no part
CONCAVE, CONVEX, HOLLOW, THICKNESS, TANGENT = 1.0, 0.01, 0.5, 0.05, 0.002  # weights in the cost of a merge
CONTACT = 1.2  # less the contact: a region that its neighbour encloses is bound the most
GROWTH = 0.4  # power of the smaller region's area
APART = 1.0  # cost of merging two bodies


class Merging:
    """State of the merging: features of the regions so far and of their borders.

    Args:
        regions: In an order that does not depend on the order of the faces, which breaks ties.
    """

    def __init__(self, regions: RegionFeatures) -> None:
        self._areas = regions.areas.tolist()
        self._thickness = regions.thickness.tolist()
        self._hollow = regions.hollow.tolist()
        self._perimeter = np.bincount(
            regions.pairs.ravel(), np.repeat(regions.lengths, 2), minlength=len(regions.areas)
        ).tolist()
        self._borders: list[dict[int, tuple[float, float, float]]] = [{} for _ in self._areas]
        creases = zip(regions.concave.tolist(), regions.convex.tolist(), strict=True)
        for (a, b), length, (concave, convex) in zip(
            regions.pairs.tolist(), regions.lengths.tolist(), creases, strict=True
        ):
            self._borders[a][b] = self._borders[b][a] = (length, length * concave, length * convex)
        self._merges: list[tuple[int, int]] = []
        self._costs: list[float] = []

    def run(self) -> tuple[Int[ndarray, "m 2"], Float[ndarray, " m"], int]:
        """Merge all regions that touch, too small ones first.

        Returns:
            The merges in their order (the region that stays, the one that joins it), their costs, and how many of the
            first merges only absorb regions that are too small for a part.
        """
        heap = [self._candidate(a, b) for a in range(len(self._areas)) for b in self._borders[a] if a < b]
        heapq.heapify(heap)
        absorbed = 0
        while heap:
            candidate = heapq.heappop(heap)
            large, cost, a, b = candidate
            if b not in self._borders[a] or self._candidate(a, b) != candidate:
                continue
            absorbed += not large
            self._merge(a, b, cost)
            for other in self._borders[a]:
                heapq.heappush(heap, self._candidate(min(a, other), max(a, other)))
        return np.array(self._merges, dtype=np.int64).reshape(-1, 2), np.array(self._costs), absorbed

    def _candidate(self, a: int, b: int) -> tuple[bool, float, int, int]:
        """Sort key of the merge of two regions, a < b."""
        return min(self._areas[a], self._areas[b]) >= SMALLEST, float(f"{self._cost(a, b):.7g}"), a, b

    def _cost(self, a: int, b: int) -> float:
        """Cost of merging two regions that touch."""
        length, concave, convex = self._borders[a][b]
        contact = length / min(self._perimeter[a], self._perimeter[b])
        pocket = min(self._hollow[a], self._hollow[b])
        crease = (CONCAVE * (1 - pocket) * concave + CONVEX * convex) / length
        hollow = HOLLOW * abs(self._hollow[a] - self._hollow[b])
        step = THICKNESS * min(abs(self._thickness[a] - self._thickness[b]), 1.0)
        size = min(self._areas[a], self._areas[b]) ** GROWTH
        cost: float = size * (crease + hollow + step + TANGENT) * (CONTACT - contact)
        return cost

    def _merge(self, a: int, b: int, cost: float) -> None:
        """Merge b into a."""
        self._merges.append((a, b))
        self._costs.append(cost)
        share = self._areas[b] / (self._areas[a] + self._areas[b])
        for values in (self._thickness, self._hollow):
            values[a] += share * (values[b] - values[a])
        self._areas[a] += self._areas[b]
        self._perimeter[a] += self._perimeter[b] - 2 * self._borders[a][b][0]
        del self._borders[a][b], self._borders[b][a]
        for other, (length, concave, convex) in self._borders[b].items():
            first = self._borders[a].get(other, (0.0, 0.0, 0.0))
            both = (first[0] + length, first[1] + concave, first[2] + convex)
            del self._borders[other][b]
            self._borders[a][other] = self._borders[other][a] = both
        self._borders[b] = {}
