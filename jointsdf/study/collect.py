"""Result rows as one DataFrame: a line per run and evaluation protocol."""

import logging
import os
from collections.abc import Collection, Sequence
from pathlib import Path

import pandas as pd

from jointsdf.runs.csv import read_committed
from jointsdf.runs.plan import PLAN, read_plan
from jointsdf.runs.records import flatten_rows
from jointsdf.runs.row import ResultRow, read_rows, run_key

log = logging.getLogger(__name__)


def collect(rows: Sequence[ResultRow]) -> pd.DataFrame:
    """Put the rows into a DataFrame with the columns of `runs.records`; NaN for a missing value."""
    return pd.DataFrame(flatten_rows(rows))


def load_rows(
    outputs: Path, results: Path, heads: Collection[str] | None = None, *, every_study: bool = True
) -> tuple[list[ResultRow], int]:
    """Load the rows of all runs below a folder, and the committed rows of other runs.

    Args:
        outputs: Folder of the runs.
        results: Folder of the committed studies; a missing one holds none.
        heads: Only these heads; None for all.
        every_study: Whether to take committed studies besides those that have rows below the folder, if any have.

    Returns:
        The rows; and the number of files that were passed over, of rows or plans, each of which is logged.

    Raises:
        ValueError: There is no readable row, or none of a head. One line, with the fix.
    """
    rows, problems = read_rows(outputs)
    committed, more = read_committed(results)
    plans = [read_plan(study)[1] for study in sorted(outputs.glob("*")) if os.path.lexists(study / PLAN)]
    problems += [*more, *filter(None, plans)]
    for problem in problems:
        log.warning(problem)
    here = {run_key(row) for row in rows}
    studies = {row.study for row in rows if not every_study}
    rows += [row for row in committed if run_key(row) not in here and (not studies or row.study in studies)]
    if not rows:
        raise ValueError(f"{outputs}: no result rows below it; make one with `python train.py`, or name another folder")
    known = sorted({row.head for row in rows})
    if unknown := [name for name in heads or [] if name not in known]:
        raise ValueError(f"heads: no row of {', '.join(unknown)!r}; there are rows of {', '.join(known)}")
    return [row for row in rows if heads is None or row.head in heads], len(problems)
