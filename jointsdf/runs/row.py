"""Result row of one run: typed, written last and atomically. No number comes from a log. Imports no torch."""

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, NoReturn, get_origin

import numpy as np

from jointsdf.runs.files import write_atomically

SCHEMA = 1
ROW_FILE = "result.json"
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


def write_row(folder: Path, row: ResultRow) -> Path:
    """Write the row as `result.json` of a run folder: strict JSON, NaN and infinities as null.

    Raises:
        OSError: The folder cannot be written or the disk is full. No partial row is left.
    """
    path = folder / ROW_FILE
    write_atomically(path, json.dumps(_plain(asdict(row)), indent=2, allow_nan=False) + "\n")
    return path


def read_row(path: Path) -> ResultRow:
    """Read a row written by `write_row`; null numbers come back as NaN.

    Raises:
        ValueError: The file is not a row of this schema. One line: the file, what is wrong, the fix.
        OSError: The file cannot be opened.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"), parse_constant=_refuse_constant)
        return parse_row(content)
    except ValueError as error:
        raise ValueError(f"{path}: not a readable result row: {error}") from error


def read_rows(root: Path) -> tuple[list[ResultRow], list[str]]:
    """Read every `result.json` below a folder, in the order of their paths.

    Args:
        root: Folder to search; a missing one holds no rows.

    Returns:
        The rows, and one line for each file that was left out: unreadable, or a second row of the same run.
    """
    rows: dict[tuple[str, ...], tuple[ResultRow, Path]] = {}
    problems: list[str] = []
    for path in sorted(root.rglob(ROW_FILE)):
        try:
            row = read_row(path)
        except (ValueError, OSError) as error:
            problems.append(str(error))
            continue
        key = run_key(row)
        if key in rows:
            problems.append(f"{path}: left out, the same run as {rows[key][1]}; delete one of the two")
        else:
            rows[key] = (row, path)
    return [row for row, _ in rows.values()], problems


def parse_row(content: Any) -> ResultRow:
    """Validate the content of a `result.json` and build its row.

    Raises:
        ValueError: It is not a row of this schema. One line, with the fix.
    """
    again = "delete the file and run that fit again"
    if not isinstance(content, dict) or not isinstance(content.get("schema"), int):
        raise ValueError(f"no schema number in it; {again}")
    if content["schema"] != SCHEMA:
        newer = content["schema"] > SCHEMA
        fix = f"newer than {SCHEMA}: update jointsdf" if newer else f"older than {SCHEMA}: {again}"
        raise ValueError(f"schema {content['schema']} is {fix}")
    kinds: dict[str, Any] = {field.name: get_origin(field.type) or field.type for field in fields(ResultRow)}
    if names := sorted(kinds.keys() ^ content.keys()):
        raise ValueError(f"missing or unknown keys: {', '.join(names)}; {again}")
    try:
        content["counts"] = {name: int(value) for name, value in content["counts"].items()}
        content["seconds"] = _floats(content["seconds"])
        content["peak_memory_mb"] = _floats({"peak": content["peak_memory_mb"]})["peak"]
        content["scores"] = {protocol: _floats(values) for protocol, values in content["scores"].items()}
    except (ValueError, TypeError, AttributeError) as error:
        raise ValueError(f"counts, seconds, peak_memory_mb and scores must hold numbers; {again}") from error
    if wrong := [name for name, kind in kinds.items() if not isinstance(content[name], kind)]:
        raise ValueError(f"wrong type of {', '.join(wrong)}; {again}")
    return ResultRow(**content)


def config_hash(resolved: Mapping[str, Any]) -> str:
    """Hash of a resolved config: the first 16 hex digits of the sha256 of its canonical JSON.

    >>> config_hash({"seed": 0, "head": "siren"}) == config_hash({"head": "siren", "seed": 0})
    True
    """
    canonical = json.dumps(_plain(resolved), sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(canonical.encode()).hexdigest()[:16]


def _plain(value: Any) -> Any:
    """The value with JSON's types alone; what is not finite becomes None."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _refuse_constant(token: str) -> NoReturn:
    raise ValueError(f"{token} is not JSON; delete the file and run that fit again")


def _floats(values: dict[str, Any]) -> dict[str, float]:
    return {name: math.nan if value is None else float(value) for name, value in values.items()}
