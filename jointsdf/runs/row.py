"""Result row of one run: typed, written last and atomically. No number comes from a log. Imports no torch."""

import json
import math
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from jointsdf.errors import DamagedFile, InputError, shown
from jointsdf.runs.files import write_atomically
from jointsdf.runs.row_content import AGAIN, SCHEMA, check_content
from jointsdf.runs.seals import canonical_hash, require_sealed, seal, unseal
from jointsdf.runs.stored_json import read_json

ROW_FILE = "result.json"
MOST_SHOWN = 4096  # characters of a path in a message
Fact = str | int | float | bool | dict[str, Any]


@dataclass(frozen=True)
class ResultRow:
    """Scores, costs and provenance of one fit. Missing numbers are NaN, never 0.

    Attributes:
        study: Name of the sweep, or of the recipe for a plain run.
        variant: `base`, or the key=value that an ablation varies.
        recipe: Name of the information and budget that the fit used.
        head: Segmentation head, `none` for the baseline without one.
        shape: Catalogue name, or `<stem>-<6 hex digits>` for a mesh file.
        seed: Of initialisation and samples.
        status: `ok`, or `empty_mesh` when the field has no zero level set in the box.
        steps: Training steps taken.
        num_parts: Number of parts of the ground truth.
        counts: Sizes, e.g. `faces_gt`, `faces_pred`, `parameters_trunk`, `parameters_head`.
        seconds: Wall-clock of each stage, e.g. `load`, `fit`, `extract`, `evaluate`, `total`.
        peak_memory_mb: Largest memory of the run, MiB.
        scores: Evaluation protocol -> metric -> value.
        provenance: Origin of the numbers; see `provenance.py`.
        schema: Version of this layout.
    """

    study: str
    variant: str
    recipe: str
    head: str
    shape: str
    seed: int
    status: str
    steps: int
    num_parts: int
    counts: dict[str, int]
    seconds: dict[str, float]
    peak_memory_mb: float
    scores: dict[str, dict[str, float]]
    provenance: dict[str, Fact]
    schema: int = SCHEMA


def run_key(row: ResultRow) -> tuple[str, ...]:
    """The fields that tell runs apart; two rows of one key are of the same run and never share a table."""
    names = (row.study, row.variant, row.recipe, row.head, row.shape, str(row.seed))
    return (*names, str(row.provenance.get("label_provider")))


def score_of(row: ResultRow, protocol: str, metric: str) -> float:
    """A score, NaN where the row has none: a row of a stranger need not have those of this program's protocols."""
    return row.scores.get(protocol, {}).get(metric, math.nan)


def write_row(folder: Path, row: ResultRow) -> Path:
    """Write the row as `result.json` of a run folder: strict JSON, NaN and infinities as null; with `seals.py`.

    Raises:
        InputError: An entry has a name that is another column's, or that no table can show.
        OSError: The folder cannot be written or the disk is full. No partial row is left.
    """
    path, content = folder / ROW_FILE, _plain(asdict(row))
    try:
        check_content(content)
    except ValueError as error:
        raise InputError(f"{path} is not written, since it could not be read: {error}") from error
    write_atomically(path, json.dumps(seal(content, folder), indent=2, allow_nan=False) + "\n")
    return path


def read_row(path: Path) -> ResultRow:
    """Read a row written by `write_row`; null numbers come back as NaN.

    Raises:
        DamagedFile: The file is missing, cannot be opened, was changed since, or is not a row of this schema. One line,
            with the fix.
    """
    try:
        content = read_json(path)
        row = parse_row(unseal(content))
        require_sealed(content)
        return row
    except FileNotFoundError as error:
        raise DamagedFile(f"{shown(path, MOST_SHOWN)}: no such file; the same train.py command makes it") from error
    except ValueError as error:
        fix = "" if ";" in str(error) else f"; {AGAIN}"
        raise DamagedFile(f"{shown(path, MOST_SHOWN)}: not a readable result row: {error}{fix}") from error


def read_rows(root: Path) -> tuple[list[ResultRow], list[str]]:
    """Read every `result.json` below a folder, in the order of their paths.

    Args:
        root: Folder to search; a missing one holds no rows.

    Returns:
        The rows, and one line for each file that was left out: unreadable, or a second row of the same run.
    """
    rows: dict[tuple[str, ...], tuple[ResultRow, Path]] = {}
    problems: list[str] = []
    for path in _row_files(root):
        try:
            row = read_row(path)
        except DamagedFile as error:
            problems.append(str(error))
            continue
        key = run_key(row)
        if key in rows:
            twin = shown(rows[key][1], MOST_SHOWN)
            problems.append(f"{shown(path, MOST_SHOWN)}: left out, the same run as {twin}; delete one of the two")
        else:
            rows[key] = (row, path)
    return [row for row, _ in rows.values()], problems


def _row_files(root: Path) -> list[Path]:
    """Whatever has the name of a row below a folder, broken links too, which `Path.rglob` leaves out; sorted."""
    return sorted(Path(folder, ROW_FILE) for folder, *names in os.walk(root) if any(ROW_FILE in kind for kind in names))


def parse_row(content: Any) -> ResultRow:
    """Check the content of a `result.json` and build its row.

    Raises:
        ValueError: It is not a row of this schema. One line, with the fix.
    """
    return ResultRow(**check_content(content))


def config_hash(resolved: Mapping[str, Any]) -> str:
    """Hash of a resolved config: the first 16 hex digits of the sha256 of its canonical JSON.

    >>> config_hash({"seed": 0, "head": "siren"}) == config_hash({"head": "siren", "seed": 0})
    True
    """
    return canonical_hash(_plain(resolved))[:16]


def _plain(value: Any) -> Any:
    """The value with JSON's types alone; what is not finite becomes None."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value
