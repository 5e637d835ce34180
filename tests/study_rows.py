"""Result rows made by hand, and the tables that they give."""

import logging
import math
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from jointsdf.runs.row import ResultRow, write_row
from jointsdf.study.__main__ import main as study
from jointsdf.study.collect import load_rows
from jointsdf.study.tables.write import write_tables

NAN = math.nan
ROW = ResultRow(
    study="fast",
    variant="base",
    recipe="fast",
    head="siren",
    shape="part_01",
    seed=0,
    status="ok",
    steps=1200,
    num_parts=7,
    counts={"faces_gt": 1200, "parameters_trunk": 264449},
    seconds={"fit": 41.5, "total": 60.0},
    peak_memory_mb=812.25,
    scores={"unit": {"cd_l1": 0.25, "iou_0": 0.97}, "flatcad": {"cd_l1": 0.31}},
    provenance={"commit": "abc", "dirty": False, "label_provider": "builtin", "versions": {"torch": "2.13.0"}},
)


def make_row(
    head: str = "relu",
    shape: str = "abc_0001",
    seed: int = 0,
    *,
    study: str = "fast",
    recipe: str = "fast",
    variant: str = "base",
    provider: str = "brep",
    status: str = "ok",
    protocol: str = "unit",
    sha: str | None = None,
    parts: int = 2,
    **metrics: float,
) -> ResultRow:
    return ResultRow(
        study=study,
        variant=variant,
        recipe=recipe,
        head=head,
        shape=shape,
        seed=seed,
        status=status,
        steps=10,
        num_parts=parts,
        counts={"faces_pred": 100},
        seconds={"fit": 2.5},
        peak_memory_mb=100.0,
        scores={protocol: metrics},
        provenance={
            "label_provider": provider,
            "mesh_sha256": sha or shape,
            "versions": {"torch": "2.13.0"},
            "machine": "a machine",
            "device": "cpu",
            "threads": 2,
        },
    )


def write(outputs: Path, *rows: ResultRow) -> None:
    for number, row in enumerate(rows):
        write_row(outputs / f"run{number:04d}", row)


def make_tables(outputs: Path, results: Path | None = None) -> list[Path]:
    results = results or outputs / "no-results"
    return write_tables(load_rows(outputs, results)[0], outputs, results)


def line(table: pd.DataFrame, head: str) -> pd.Series:
    (_, found), *others = table[table["head"] == head].iterrows()
    assert not others
    return found


def results_with_the_paper(folder: Path) -> Path:
    """Committed results that hold the paper's numbers alone."""
    shutil.copytree(Path(__file__).parents[1] / "results" / "paper", folder / "results" / "paper", dirs_exist_ok=True)
    return folder / "results"


def table_path(outputs: Path, name: str) -> Path:
    """The only file of that name among the tables, of whichever study."""
    (path,) = (outputs / "tables").rglob(name)
    return path


def read_table(outputs: Path, name: str) -> pd.DataFrame:
    return pd.read_csv(table_path(outputs, f"{name}.csv"))


def read_tex(outputs: Path, name: str) -> str:
    return table_path(outputs, f"{name}.tex").read_text(encoding="utf-8")


def values_of(outputs: Path, head: str, metric: str) -> np.ndarray:
    runs = pd.read_csv(outputs / "tables" / "runs.csv")
    return runs[runs["head"] == head].sort_values("shape")[metric].to_numpy()


def place_of(outputs: Path, head: str, shape: str, seed: int = 0, variant: str = "base") -> Path:
    return outputs / "main" / variant / head / shape / f"seed{seed}"


def write_finished(outputs: Path, head: str, shape: str, **where: int | str) -> ResultRow:
    folder = place_of(outputs, head, shape, **where)
    named = {"study": "main", "head": head, "shape": shape, **where}
    row = replace(ROW, seconds={"fit": 80.0, "total": 100.0}, **named)
    write_row(folder, row)
    return row


def answer_of(caplog: pytest.LogCaptureFixture, *arguments: str) -> list[str]:
    caplog.clear()
    with caplog.at_level(logging.INFO):
        assert study(arguments) == 0
    return "\n".join(caplog.messages).splitlines()
