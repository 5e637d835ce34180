"""Reuse of finished runs: a row of another study with the same fingerprint is this run's row as well."""

import glob
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from jointsdf.errors import DamagedFile
from jointsdf.runs.csv import FILE, read_committed
from jointsdf.runs.folder import REUSED
from jointsdf.runs.row import ROW_FILE, ResultRow, read_row


def find_reusable_row(
    fingerprint_hash: str, folder: Path, outputs: Path, results: Path, *, recipe: str
) -> ResultRow | None:
    """Find a finished run of the same fingerprint; its row as this run's, with its origin in the provenance.

    Args:
        fingerprint_hash: `config_hash` of the run's fingerprint.
        folder: The run folder, `<outputs>/<study>/<variant>/<head>/<shape>/seed<k>`.
        outputs: Folder of the runs of every study.
        results: Folder of the committed rows, `<study>/runs.csv`.
        recipe: Name of this run's recipe, which decides no number.

    Returns:
        The row with this run's study, variant and recipe; None where no run has the fingerprint.
    """
    study, variant, *_ = folder.relative_to(outputs).parts
    for row, source in _candidates(folder, outputs, results):
        if row.provenance.get("config_hash") == fingerprint_hash:
            provenance = {REUSED: source} | row.provenance
            return replace(row, study=study, variant=variant, recipe=recipe, provenance=provenance)
    return None


def _candidates(folder: Path, outputs: Path, results: Path) -> Iterator[tuple[ResultRow, str]]:
    """Rows of the same head, shape and seed with their origin, runs on this disk first; damaged ones are skipped."""
    head, shape, seed = folder.parts[-3:]
    for found in sorted(outputs.glob(f"*/*/{glob.escape(head)}/{glob.escape(shape)}/{seed}/{ROW_FILE}")):
        try:
            yield read_row(found), found.parent.relative_to(outputs).as_posix()
        except DamagedFile:
            continue
    for row in read_committed(results)[0]:
        if (row.head, row.shape, f"seed{row.seed}") == (head, shape, seed):
            yield row, (results / row.study / FILE).as_posix()
