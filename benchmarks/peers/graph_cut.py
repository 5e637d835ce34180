"""Labels by alpha expansion (Boykov, Veksler and Zabih 2001) on the dual graph of a mesh."""

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from benchmarks.peers import libraries

SMOOTHNESS = 0.5  # weight of the borders' length
PRIOR = 0.5  # votes that every candidate has beside its own
MOST_SWEEPS = 5  # over all labels


class Energy:
    """Energy of a labelling: Potts model between neighbouring faces, a logarithm of votes on each.

        sum_f a_f D_f(l_f) + smoothness sum_{fg} w_fg [l_f != l_g],   D_f(l) = -log((votes_f(l) + 1/2) / most)

    a is the area over its mean, w the length of the common edge over its mean times max(cos angle, 0): a border along a
    crease is free. A face may take labels alone that one of its votes has.

    Args:
        votes: Of each face for each label.
        areas: Of the faces.
        pairs: Neighbouring faces.
        lengths: Of their common edges.
        angles: Between their normals, radians.
    """

    def __init__(
        self,
        votes: Int[ndarray, "f k"],
        areas: Float[ndarray, " f"],
        pairs: Int[ndarray, "p 2"],
        lengths: Float[ndarray, " p"],
        angles: Float[ndarray, " p"],
    ) -> None:
        self.candidates: Bool[ndarray, "f k"] = votes > 0
        most = votes.sum(axis=1, keepdims=True) + PRIOR
        self.costs = -np.log((votes + PRIOR) / most) * (areas / areas.mean())[:, None]
        self.pairs = pairs
        mean = lengths.mean() if len(lengths) else 1.0
        self.weights = SMOOTHNESS * lengths / mean * np.maximum(np.cos(angles), 0)

    def of(self, labels: Int[ndarray, " f"]) -> float:
        """The energy of a labelling."""
        differ = labels[self.pairs[:, 0]] != labels[self.pairs[:, 1]]
        return float(self.costs[np.arange(len(labels)), labels].sum() + self.weights[differ].sum())

    def expand(self, labels: Int[ndarray, " f"], label: int) -> Int[ndarray, " f"]:
        """The best labelling in which any faces take the label, by one minimum cut (Kolmogorov and Zabih 2004)."""
        free = self.candidates[:, label] & (labels != label)
        if not free.any():
            return labels
        number = np.cumsum(free) - 1
        keep = self.costs[np.arange(len(labels)), labels][free]
        take = self.costs[free, label]
        one, other = self.pairs.T
        for here, there in ((one, other), (other, one)):
            fixed = free[here] & ~free[there]  # the neighbour keeps its label
            at, weights = number[here[fixed]], self.weights[fixed]
            keep += np.bincount(at, weights * (labels[here[fixed]] != labels[there[fixed]]), len(keep))
            take += np.bincount(at, weights * (labels[there[fixed]] != label), len(keep))
        both = free[one] & free[other]
        first, second, weights = number[one[both]], number[other[both]], self.weights[both]
        together = weights * (labels[one[both]] != labels[other[both]])  # cost of both keeping theirs
        take += np.bincount(first, weights - together, len(keep))
        take -= np.bincount(second, weights, len(keep))
        taken = _minimum_cut(keep, take, first, second, 2 * weights - together)
        chosen = labels.copy()
        chosen[np.flatnonzero(free)[taken]] = label
        return chosen


def cut_labels(
    votes: Int[ndarray, "f k"],
    areas: Float[ndarray, " f"],
    pairs: Int[ndarray, "p 2"],
    lengths: Float[ndarray, " p"],
    angles: Float[ndarray, " p"],
) -> Int[ndarray, " f"]:
    """A labelling whose `Energy` no expansion of a label lowers, from that of the most votes."""
    energy = Energy(votes, areas, pairs, lengths, angles)
    labels = votes.argmax(axis=1)
    lowest = energy.of(labels)
    for _ in range(MOST_SWEEPS):
        before = lowest
        for label in range(votes.shape[1]):
            candidate = energy.expand(labels, label)
            if candidate is not labels and (found := energy.of(candidate)) < lowest - 1e-9:
                labels, lowest = candidate, found
        if lowest == before:
            break
    return labels


def _minimum_cut(
    keep: Float[ndarray, " n"],
    take: Float[ndarray, " n"],
    first: Int[ndarray, " p"],
    second: Int[ndarray, " p"],
    apart: Float[ndarray, " p"],
) -> Bool[ndarray, " n"]:
    """Nodes that take the label where the sum of their costs is least; `apart` is paid where the second alone does."""
    library = libraries.maxflow()
    graph = library.GraphFloat(len(keep), len(first))
    nodes = graph.add_grid_nodes(len(keep))
    least = np.minimum(keep, take)
    graph.add_grid_tedges(nodes, take - least, keep - least)
    graph.add_edges(first, second, apart, np.zeros_like(apart))
    graph.maxflow()
    return np.asarray(graph.get_grid_segments(nodes))
