"""Comparisons of heads on the shapes that all of them were run on."""

import math
import re
from dataclasses import dataclass, replace
from functools import cached_property

import pandas as pd

from jointsdf.study.groups import BASELINE, Group
from jointsdf.study.statistics import common_shapes

HEAD_ORDER = (BASELINE, "relu", "siren", "hybrid", "deep_skip")  # the paper's; other heads follow by name


@dataclass(frozen=True)
class Comparison:
    """Runs of several heads on the same shapes.

    Attributes:
        group: Source of the runs.
        heads: In the order of the table's lines.
        shapes: Those that every head was run on.
        dropped: The other shapes, each with the heads that lack it.
        runs: Lines of `collect`, of these shapes only.
    """

    group: Group
    heads: list[str]
    shapes: list[str]
    dropped: dict[str, list[str]]
    runs: pd.DataFrame

    def of(self, head: str) -> pd.DataFrame:
        """The runs of one head."""
        return self._by_head.get(head, self.runs[:0])

    @cached_property
    def _by_head(self) -> dict[str, pd.DataFrame]:
        """The runs of each head, taken from the table once: every metric asks for them."""
        return {str(head): part for head, part in self.runs.groupby("head")}


def compare(group: Group, *, baseline: bool) -> Comparison:
    """Restrict the group to the shapes that every head was run on.

    Args:
        group: Runs that may be compared.
        baseline: Whether the head `none` takes part.
    """
    runs = group.runs if baseline else group.runs[group.runs["head"] != BASELINE]
    shapes, dropped = common_shapes(runs)
    heads = sorted(runs["head"].unique(), key=lambda head: (head not in HEAD_ORDER, _place(head), natural_key(head)))
    return Comparison(group, heads, shapes, dropped, runs[runs["shape"].isin(shapes)])


def add_borrowed_baseline(group: Group) -> Group:
    """Add the borrowed baseline runs to the group's own."""
    return group if group.borrowed.empty else replace(group, runs=pd.concat([group.runs, group.borrowed]))


def natural_key(text: str) -> list[tuple[float, str]]:
    """Sort key in natural order: numbers within a text by their size.

    >>> sorted(["tap=10", "tap=2", "tap=2.5"], key=natural_key)
    ['tap=2', 'tap=2.5', 'tap=10']
    """
    parts = re.split(r"(\d+(?:\.\d+)?)", text)
    return [(float(part), "") if place % 2 else (math.inf, part) for place, part in enumerate(parts)]


def _place(head: str) -> int:
    return HEAD_ORDER.index(head) if head in HEAD_ORDER else 0
