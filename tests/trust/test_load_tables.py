"""Load on tables: memory of wide tables, and as many selections as heads and shapes, not as metrics."""

import tracemalloc
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest
from study_rows import make_row

from jointsdf.runs.csv import rows_from_csv, rows_to_csv
from jointsdf.runs.records import flatten_rows
from jointsdf.runs.row import ResultRow
from jointsdf.study.tables.write import write_tables

SHAPES = 30
PARTS = 1280


def rows(seeds: int) -> list[ResultRow]:
    """One of the shapes has a thousand parts, the others two."""
    many = {f"iou_{part}": 0.5 for part in range(PARTS)}
    made = [make_row("siren", f"abc_{k:04}", seed, iou_0=0.5) for k in range(SHAPES) for seed in range(seeds)]
    return [*made, replace(make_row("siren", "abc_9999"), scores={"unit": many})]


def test_one_shape_of_many_parts_does_not_multiply_the_memory_of_all() -> None:
    made = rows(20)
    tracemalloc.start()
    try:
        table = flatten_rows(made)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert len(table["iou_1279"]) == len(made) == 601
    assert peak < 2 * 8 * len(table) * len(made) + 5e6, "more than a pointer for each cell"
    assert rows_from_csv(rows_to_csv(made)) == sorted(made, key=lambda row: (row.shape, row.seed))


def test_tables_group_the_runs_by_head_and_shape_not_by_metric(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    taken: list[int] = []
    original = pd.DataFrame.__getitem__

    def counted(self, key):
        found = original(self, key)
        if isinstance(key, pd.Series):  # a selection of rows, each of which copies every column
            taken.append(len(found))
        return found

    monkeypatch.setattr(pd.DataFrame, "__getitem__", counted)
    heads = ("none", "relu", "siren", "hybrid")
    metrics = dict.fromkeys(("cd_l1", "cd_l2", "nc", "f1", "miou", "acc", "consistency", "miou_exact"), 0.5)
    made = [make_row(head, f"abc_{k:04}", **metrics) for head in heads for k in range(8)]
    write_tables(made, tmp_path, tmp_path)
    assert len(taken) < 85, "one for each head of each metric of each table would be 108"
