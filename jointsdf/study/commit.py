"""Merge a study's rows into one file to be committed, `results/<study>/runs.csv`, from which any clone reuses them."""

from pathlib import Path

from jointsdf.runs.csv import FILE, read_csv, rows_to_csv
from jointsdf.runs.files import write_atomically
from jointsdf.runs.row import ResultRow, read_rows, run_key


def commit_rows(study: Path, results: Path) -> tuple[Path, int, list[str]]:
    """Merge the study's rows into its committed file; rows of runs that are not here, e.g. of another machine, stay.

    Args:
        study: The study's folder, `<outputs>/<study>`.
        results: Folder of the committed studies.

    Returns:
        The file, the number of its rows, and a line for each row that was left out.

    Raises:
        ValueError: There is no row, or the file is damaged; it is left as it is. One line, with the fix.
    """
    rows, problems = read_rows(study)
    path = results / study.name / FILE
    merged: dict[tuple[str, ...], ResultRow] = {}
    if path.is_file():
        merged = {run_key(row): row for row in read_csv(path)}
    if not rows:
        raise ValueError(f"{study}: no result rows below it; `python train.py sweeps={study.name}` makes them")
    merged |= {run_key(row): row for row in rows}
    write_atomically(path, rows_to_csv(list(merged.values())))
    return path, len(merged), problems
