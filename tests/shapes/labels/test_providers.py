"""Sources of part labels, and the benchmark's numbers of parts."""

import csv
from importlib import resources

from jointsdf.shapes import abc


def test_benchmark_table_names_every_catalogue_shape_once() -> None:
    text = resources.files("jointsdf.shapes").joinpath("benchmark.csv").read_text(encoding="utf-8")
    rows = list(csv.DictReader(text.splitlines()))
    assert [row["shape"] for row in rows] == list(abc.catalogue())
    counts = [int(row["num_parts"]) for row in rows]
    assert min(counts) >= 2
    assert max(counts) == 18
    assert len(set(counts)) >= 10, "spread over the whole range"
