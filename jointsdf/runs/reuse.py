"""Rows of other studies that are this run's as well: the same numbers in, so the same numbers out."""

import glob
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from jointsdf.runs.csv import FILE, read_committed
from jointsdf.runs.folder import REUSED
from jointsdf.runs.row import ROW_FILE, ResultRow, read_row


def known_row(identity_hash: str, folder: Path, outputs: Path, results: Path) -> ResultRow | None:
    """A finished run with the same identity as a row of this one; its provenance says where it was taken from.

    Args:
        identity_hash: Of the numbers that decide the run's.
        folder: The run folder, `<outputs>/<study>/<variant>/<head>/<shape>/seed<k>`.
        outputs: Where the runs of every study are.
        results: Where the committed rows are, `<study>/runs.csv`.
    """
    study, variant, *_ = folder.relative_to(outputs).parts
    for row, source in _candidates(folder, outputs, results):
        if row.provenance.get("config_hash") == identity_hash:
            provenance = {REUSED: source} | row.provenance
            return replace(row, study=study, variant=variant, provenance=provenance)
    return None


def _candidates(folder: Path, outputs: Path, results: Path) -> Iterator[tuple[ResultRow, str]]:
    """Rows of the same head, shape and seed, those of runs on this disk first; damaged ones are left out."""
    head, shape, seed = folder.parts[-3:]
    for found in sorted(outputs.glob(f"*/*/{glob.escape(head)}/{glob.escape(shape)}/{seed}/{ROW_FILE}")):
        try:
            yield read_row(found), found.parent.relative_to(outputs).as_posix()
        except ValueError:
            continue
    for row in read_committed(results)[0]:
        if (row.head, row.shape, f"seed{row.seed}") == (head, shape, seed):
            yield row, (results / row.study / FILE).as_posix()
