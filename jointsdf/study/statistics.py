"""Averages that say what they average over. NaN is a missing value, never 0."""

import math
import statistics
from collections.abc import Iterable
from dataclasses import dataclass

import pandas as pd


@dataclass(frozen=True)
class Summary:
    """Mean and spread of one number over shapes.

    Attributes:
        n: Number of shapes that have the number.
        mean: Over those shapes; NaN for n = 0.
        std: Sample standard deviation (n - 1 in the denominator); 0 for n = 1, NaN for n = 0.
    """

    n: int
    mean: float
    std: float


def summarise(values: Iterable[float]) -> Summary:
    """Summarise one value per shape; NaN are left out and not counted."""
    present = [value for value in values if not math.isnan(value)]
    if not present:
        return Summary(0, math.nan, math.nan)
    return Summary(len(present), statistics.fmean(present), statistics.stdev(present) if len(present) > 1 else 0.0)


def per_shape(runs: pd.DataFrame, metric: str) -> dict[str, float]:
    """One value per shape: the mean over its runs (the seeds of one head) that have the metric, NaN if none has."""
    if metric not in runs:
        return dict.fromkeys(runs["shape"], math.nan)
    return {str(shape): float(mean) for shape, mean in runs.groupby("shape")[metric].mean().items()}


def common_shapes(runs: pd.DataFrame) -> tuple[list[str], dict[str, list[str]]]:
    """Split the shapes into those that every head has a run of, and the others.

    Returns:
        The common shapes, sorted; and for each other shape the heads without it.
    """
    shapes_of = {str(head): set(part["shape"]) for head, part in runs.groupby("head")}
    missing = {
        str(shape): [head for head, shapes in shapes_of.items() if shape not in shapes]
        for shape in sorted(set(runs["shape"]))
    }
    return [shape for shape, heads in missing.items() if not heads], {s: h for s, h in missing.items() if h}
