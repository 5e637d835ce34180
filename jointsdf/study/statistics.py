"""Averages, paired tests and correlations, each with its sample size. NaN is a missing value, never 0."""

import math
import statistics
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from jaxtyping import Float
from numpy import ndarray
from scipy import stats

CONFIDENCE = 0.95
ROUNDING = 1e-12  # relative spread below which numbers count as equal
MOST_SIGNED = 13  # differences of which all signs are tried, where ranks are shared: 2^13 outcomes


@dataclass(frozen=True)
class Summary:
    """Mean and spread of one number over shapes.

    Attributes:
        n: Number of shapes that have the number.
        mean: Over those shapes; NaN for n = 0.
        std: Sample standard deviation (n - 1 in the denominator); NaN below n = 2.
    """

    n: int
    mean: float
    std: float


def summarise(values: Iterable[float]) -> Summary:
    """Mean and sample standard deviation of one value per shape; NaN are left out and not counted.

    >>> summarise([1.0, math.nan, 3.0, 5.0])
    Summary(n=3, mean=3.0, std=2.0)
    """
    present = [value for value in values if not math.isnan(value)]
    if not present:
        return Summary(0, math.nan, math.nan)
    return Summary(len(present), statistics.fmean(present), statistics.stdev(present) if len(present) > 1 else math.nan)


def per_shape(runs: pd.DataFrame, metric: str) -> dict[str, float]:
    """One value per shape: the mean over its runs (the seeds of one head) that have the metric, NaN if none has."""
    return shape_means(runs, [metric])[metric]


def shape_means(runs: pd.DataFrame, metrics: Sequence[str]) -> dict[str, dict[str, float]]:
    """The values of `per_shape` by metric: the runs are grouped by shape once for all of them."""
    known = [metric for metric in metrics if metric in runs]
    found = runs.groupby("shape")[known].mean().astype(float).to_dict() if known else {}
    return {metric: found.get(metric) or dict.fromkeys(runs["shape"], math.nan) for metric in metrics}


def pooled_deviation(runs: pd.DataFrame, metric: str) -> tuple[int, float]:
    """Number of shapes with several runs (seeds), and their pooled standard deviation over those; NaN for none."""
    if metric not in runs:
        return 0, math.nan
    by_shape = runs.dropna(subset=metric).groupby("shape")[metric]
    freedom = by_shape.count() - 1
    squares = (by_shape.var(ddof=1) * freedom)[freedom > 0]
    return len(squares), math.sqrt(squares.sum() / freedom.sum()) if len(squares) else math.nan


def common_shapes(runs: pd.DataFrame) -> tuple[list[str], dict[str, list[str]]]:
    """Separate the shapes that every head has a run of from the others.

    Returns:
        The common shapes, sorted; and for each other shape the heads without it.
    """
    shapes_of = {str(head): set(part["shape"].unique()) for head, part in runs.groupby("head")}
    missing = {
        str(shape): [head for head, shapes in shapes_of.items() if shape not in shapes]
        for shape in sorted(runs["shape"].unique())
    }
    return [shape for shape, heads in missing.items() if not heads], {s: h for s, h in missing.items() if h}


@dataclass(frozen=True)
class PairedTests:
    """Paired tests of a method against a baseline on the same shapes.

    Attributes:
        n: Shapes on which both have the number.
        delta: Mean difference, method minus baseline.
        low: Lower end of its 95% confidence interval.
        high: Upper end.
        p_t: Of the paired t-test, two-sided; NaN for n < 2 or where all differences are equal.
        p_wilcoxon: Of Wilcoxon's signed-rank test, two-sided; NaN for n < 2 or where all differences are 0.
    """

    n: int
    delta: float
    low: float
    high: float
    p_t: float
    p_wilcoxon: float


def paired_tests(method: Mapping[str, float], baseline: Mapping[str, float]) -> PairedTests:
    """Paired t-test and Wilcoxon's signed-rank test of two methods' values per shape.

    A shape without a value of either method is left out.

    >>> found = paired_tests({"a": 2.0, "b": 4.0, "c": 6.0}, {"a": 1.0, "b": 2.0, "c": 3.0})
    >>> found.n, found.delta, round(found.p_t, 4), found.p_wilcoxon
    (3, 2.0, 0.0742, 0.25)
    """
    differences = np.array([value - baseline.get(shape, math.nan) for shape, value in method.items()])
    differences = differences[~np.isnan(differences)]
    n = len(differences)
    delta = float(differences.mean()) if n else math.nan
    if n < 2 or np.ptp(differences) <= ROUNDING * abs(delta):
        return PairedTests(n, delta, math.nan, math.nan, math.nan, _wilcoxon(differences))
    test = stats.ttest_1samp(differences, 0.0)
    low, high = test.confidence_interval(CONFIDENCE)
    return PairedTests(n, delta, float(low), float(high), float(test.pvalue), _wilcoxon(differences))


def holm(p_values: Sequence[float]) -> list[float]:
    """Holm's step-down correction of a family of p values; NaN stay NaN and are not counted.

    Holm, "A simple sequentially rejective multiple test procedure", Scandinavian Journal of Statistics 6 (1979).

    >>> [round(p, 3) for p in holm([0.01, 0.04, 0.03, 0.005])]
    [0.03, 0.06, 0.06, 0.02]
    """
    order = sorted((p, place) for place, p in enumerate(p_values) if not math.isnan(p))
    corrected = [math.nan] * len(p_values)
    least = 0.0
    for rank, (p, place) in enumerate(order):
        least = max(least, min(1.0, (len(order) - rank) * p))
        corrected[place] = least
    return corrected


@dataclass(frozen=True)
class Correlation:
    """Pearson's r over n pairs and its two-sided p; NaN for n < 3 or where one side is constant."""

    n: int
    r: float
    p: float


def pearson(pairs: Iterable[tuple[float, float]]) -> Correlation:
    """Pearson's correlation of pairs; a pair with a missing number is left out."""
    present = np.array([pair for pair in pairs if not any(map(math.isnan, pair))]).reshape(-1, 2)
    spread = np.ptp(present, axis=0) if len(present) else np.zeros(2)
    if len(present) < 3 or (spread <= ROUNDING * np.abs(present).max(axis=0)).any():
        return Correlation(len(present), math.nan, math.nan)
    r, p = stats.pearsonr(*present.T)
    return Correlation(len(present), float(r), float(p))


def outer_quarters(keys: Mapping[str, float]) -> tuple[list[str], list[str]]:
    """The quarters of the shapes with the lowest and with the highest keys; sizes rounded down, NaN keys left out."""
    order = sorted((key, shape) for shape, key in keys.items() if not math.isnan(key))
    size = len(order) // 4
    return [shape for _, shape in order[:size]], [shape for _, shape in order[len(order) - size :]]


def _wilcoxon(differences: Float[ndarray, " n"]) -> float:
    """Two-sided p of Wilcoxon's signed-rank test (Wilcoxon 1945), exact in small samples.

    With zeros or equal sizes scipy tries all signs as well, but ranks anew for each: a thousand times as long.
    """
    if len(differences) < 2 or not differences.any():
        return math.nan
    sizes = np.abs(differences[differences != 0])
    if len(differences) > MOST_SIGNED or len(np.unique(sizes)) == len(differences):
        return float(stats.wilcoxon(differences).pvalue)
    ranks = np.zeros(len(differences))
    ranks[differences != 0] = stats.rankdata(sizes)

    def positive_ranks(signed: Float[ndarray, "*b n"], axis: int) -> Float[ndarray, " b"] | float:
        return ((signed > 0) * ranks).sum(axis=axis)

    kind = {"permutation_type": "samples", "vectorized": True}
    return float(stats.permutation_test((differences,), positive_ranks, **kind).pvalue)
