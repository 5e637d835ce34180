"""Run folders: read one, and claim one for a run without overwriting the run of another config."""

import logging
import os
import shutil
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import yaml

from jointsdf.errors import DamagedFile, InputError, shown
from jointsdf.runs.files import sweep_temporaries, write_atomically
from jointsdf.runs.fingerprint import NUMBERS
from jointsdf.runs.lock import LOCK
from jointsdf.runs.row import ROW_FILE, ResultRow, config_hash, read_row
from jointsdf.runs.status import STATUS
from jointsdf.runs.stored_yaml import MOST_BYTES, OutOfBounds, dump_yaml, parse_yaml
from jointsdf.runs.trusted_targets import require_trusted

CONFIG, CHECKPOINT, FIELD, BOARD = "config.yaml", "last.ckpt", "field.ckpt", "tb"
REUSED = "reused_from"  # in a row's provenance: the run or the file that it was taken from

log = logging.getLogger(__name__)


def finished_row(
    folder: Path, fingerprint: Mapping[str, Any], *, force: bool, reuse: bool, trust: Collection[str] = ()
) -> ResultRow | None:
    """The run's row where the folder holds it, else None; nothing is written.

    Args:
        folder: The run folder; need not exist.
        fingerprint: Of the run, from `fingerprint_of`.
        force: Whether to ignore what the folder holds.
        reuse: Whether to accept a row taken from another study.
        trust: As for `read_config`: also what the run's own config names.

    Raises:
        InputError: The folder holds a checkpoint or result of another config (the differing keys are listed), or a
            damaged config.
    """
    if force or not ((folder / ROW_FILE).exists() or (folder / CHECKPOINT).exists()):
        return None
    if not (folder / CONFIG).is_file():
        raise InputError(f"{folder} holds a run without its {CONFIG}; force=true starts it over")
    _refuse_another(folder, read_config(folder, trust)["identity"], fingerprint)
    try:
        row = read_row(folder / ROW_FILE)
    except DamagedFile:  # `claim` reports it
        return None
    return row if reuse or REUSED not in row.provenance else None


def claim(
    folder: Path, settings: Mapping[str, Any], fingerprint: Mapping[str, Any], *, resume: str, force: bool
) -> None:
    """Write the run's config into the folder; without a checkpoint to resume from, empty the folder first.

    A damaged result is logged, and files that a killed process did not finish are removed.

    Args:
        folder: The run folder, for which `finished_row` gave None; created where missing.
        settings: The resolved config, stored as `config.yaml`.
        fingerprint: Of the run, from `fingerprint_of`; stored there as `identity`.
        resume: `auto` resumes from the folder's checkpoint, `never` removes it.
        force: Whether to remove everything in the folder.
    """
    if not force and os.path.lexists(folder / ROW_FILE):
        try:
            read_row(folder / ROW_FILE)
        except DamagedFile as error:
            log.warning("%s; the run is done again", error)
    if folder.is_dir() and (force or resume == "never" or not (folder / CHECKPOINT).exists()):
        _clear(folder)
    sweep_temporaries(folder)
    write_atomically(folder / CONFIG, dump_yaml({**settings, "identity": dict(fingerprint)}))


def read_config(folder: Path, trust: Collection[str] = ()) -> dict[str, Any]:
    """Read the config of a run folder, which may come from a stranger.

    Args:
        folder: The run folder.
        trust: Modules or classes that it may name besides those of `runs/trusted_targets.py`.

    Raises:
        InputError: There is none, it cannot be read, or it names a class that is not trusted.
    """
    path = folder / CONFIG
    if not path.is_file():
        raise InputError(f"{folder}: not a run folder (no {CONFIG}); give one that train.py made")
    try:
        with path.open("rb") as file:
            config: dict[str, Any] = parse_yaml(file.read(MOST_BYTES + 1))
        for key in (*NUMBERS, "shape", "labels", "paths"):
            config[key]
        _flat(config["identity"]["shape"])
    except OutOfBounds as error:
        raise InputError(f"{path}: no config of a run: {error}; force=true starts the run over") from error
    except (yaml.YAMLError, ValueError, TypeError, KeyError, AttributeError) as error:
        raise InputError(f"{path}: damaged; force=true starts the run over") from error
    require_trusted(path, config, trust)
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
    except DamagedFile as error:
        raise InputError(f"{error}, or force=true") from error


def grid_of(folder: Path, row: ResultRow) -> int:
    """Grid points along each axis that a finished run extracted its mesh with.

    Args:
        folder: The run folder.
        row: Its row.

    Raises:
        InputError: The row does not say.
    """
    resolution = row.provenance.get("resolution")
    if not isinstance(resolution, int) or isinstance(resolution, bool):
        raise InputError(f"{folder / ROW_FILE}: no provenance.resolution, its mesh's grid; force=true runs it again")
    return resolution


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
        listed = ", ".join(f"{shown(key)} ({shown(before.get(key), 300)} -> {now.get(key)})" for key in differing)
        hashes = f"hash {config_hash(held)} there, {config_hash(wanted)} here"
        fix = "variant=<name> makes a new folder, force=true overwrites"
        raise InputError(f"{folder} holds another config: {listed}; {hashes}; {fix}")


def _flat(tree: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    leaves: dict[str, Any] = {}
    for key, value in tree.items():
        leaves |= _flat(value, f"{prefix}{key}.") if isinstance(value, Mapping) else {f"{prefix}{key}": value}
    return leaves
