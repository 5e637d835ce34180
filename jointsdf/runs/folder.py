"""Run folders: read one, and claim one for a run without overwriting the run of another config."""

import logging
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from jointsdf.errors import InputError
from jointsdf.runs.files import write_atomically
from jointsdf.runs.fingerprint import NUMBERS
from jointsdf.runs.lock import LOCK
from jointsdf.runs.row import ROW_FILE, ResultRow, config_hash, read_row
from jointsdf.runs.status import STATUS

CONFIG, CHECKPOINT, FIELD, BOARD = "config.yaml", "last.ckpt", "field.ckpt", "tb"
REUSED = "reused_from"  # in a row's provenance: the run or the file that it was taken from

log = logging.getLogger(__name__)


def finished_row(folder: Path, fingerprint: Mapping[str, Any], *, force: bool, reuse: bool) -> ResultRow | None:
    """The run's row where the folder holds it, else None; nothing is written.

    Args:
        folder: The run folder; need not exist.
        fingerprint: Of the run, from `fingerprint_of`.
        force: Whether to ignore what the folder holds.
        reuse: Whether to accept a row taken from another study.

    Raises:
        InputError: The folder holds a checkpoint or result of another config (the differing keys are listed), or a
            damaged config.
    """
    if force or not ((folder / ROW_FILE).exists() or (folder / CHECKPOINT).exists()):
        return None
    if not (folder / CONFIG).is_file():
        raise InputError(f"{folder} holds a run without its {CONFIG}; force=true starts it over")
    _refuse_another(folder, read_config(folder)["identity"], fingerprint)
    try:
        row = read_row(folder / ROW_FILE)
    except (FileNotFoundError, ValueError):  # `claim` reports a damaged one
        return None
    return row if reuse or REUSED not in row.provenance else None


def claim(
    folder: Path, settings: Mapping[str, Any], fingerprint: Mapping[str, Any], *, resume: str, force: bool
) -> None:
    """Write the run's config into the folder; without a checkpoint to resume from, empty the folder first.

    A damaged result is logged.

    Args:
        folder: The run folder, for which `finished_row` gave None; created where missing.
        settings: The resolved config, stored as `config.yaml`.
        fingerprint: Of the run, from `fingerprint_of`; stored there as `identity`.
        resume: `auto` resumes from the folder's checkpoint, `never` removes it.
        force: Whether to remove everything in the folder.
    """
    if not force and (folder / ROW_FILE).exists():
        try:
            read_row(folder / ROW_FILE)
        except ValueError as error:
            log.warning("%s; the run is done again", error)
    if folder.is_dir() and (force or resume == "never" or not (folder / CHECKPOINT).exists()):
        _clear(folder)
    write_atomically(folder / CONFIG, yaml.safe_dump({**settings, "identity": dict(fingerprint)}, sort_keys=False))


def read_config(folder: Path) -> dict[str, Any]:
    """Read the config of a run folder.

    Raises:
        InputError: There is none, or it cannot be read.
    """
    path = folder / CONFIG
    if not path.is_file():
        raise InputError(f"{folder}: not a run folder (no {CONFIG}); give one that train.py made")
    try:
        config: dict[str, Any] = yaml.safe_load(path.read_text(encoding="utf-8"))
        for key in (*NUMBERS, "shape", "labels", "paths"):
            config[key]
        _flat(config["identity"]["shape"])
    except (yaml.YAMLError, UnicodeDecodeError, TypeError, KeyError, AttributeError) as error:
        raise InputError(f"{path}: damaged; force=true starts the run over") from error
    return config


def read_result(folder: Path) -> ResultRow:
    """Read the row of a finished run's folder.

    Raises:
        InputError: There is none, or it cannot be read.
    """
    path = folder / ROW_FILE
    if not path.is_file():
        raise InputError(f"{folder}: no finished run (no {ROW_FILE}); the same train.py command finishes it")
    try:
        return read_row(path)
    except ValueError as error:
        raise InputError(f"{error}, or force=true") from error


def _clear(folder: Path) -> None:
    """Empty the folder except for its lock and status, which are this process's."""
    for entry in folder.iterdir():
        if entry.is_dir() and not entry.is_symlink():
            shutil.rmtree(entry)
        elif entry.name not in (LOCK, STATUS):
            entry.unlink()


def _refuse_another(folder: Path, held: Mapping[str, Any], wanted: Mapping[str, Any]) -> None:
    """Raise where the two fingerprints differ, with every differing key."""
    before, now = _flat(held), _flat(wanted)
    differing = sorted(key for key in before.keys() | now.keys() if before.get(key) != now.get(key))
    if differing:
        listed = ", ".join(f"{key} ({before.get(key)} -> {now.get(key)})" for key in differing)
        hashes = f"hash {config_hash(held)} there, {config_hash(wanted)} here"
        fix = "variant=<name> makes a new folder, force=true overwrites"
        raise InputError(f"{folder} holds another config: {listed}; {hashes}; {fix}")


def _flat(tree: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    leaves: dict[str, Any] = {}
    for key, value in tree.items():
        leaves |= _flat(value, f"{prefix}{key}.") if isinstance(value, Mapping) else {f"{prefix}{key}": value}
    return leaves
