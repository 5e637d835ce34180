"""The folder of one run: which config it holds, and whether another may have it."""

import logging
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from jointsdf.errors import InputError
from jointsdf.runs.files import write_atomically
from jointsdf.runs.lock import LOCK
from jointsdf.runs.row import ROW_FILE, ResultRow, config_hash, read_row
from jointsdf.runs.status import STATUS

CONFIG, CHECKPOINT, FIELD, BOARD = "config.yaml", "last.ckpt", "field.ckpt", "tb"
REUSED = "reused_from"  # in a row's provenance: the run or the file that it was taken from

log = logging.getLogger(__name__)

# What decides the numbers of a run; everything else in the config is where and how it runs.
NUMBERS = ("seed", "tessellation", "data", "trunk", "head", "loss", "optimizer", "trainer", "extraction", "evaluation")
PREVIEWS = ("preview_every", "preview_resolution")
MACHINE = ("accelerator", "checkpoint_seconds", "log_every", *PREVIEWS, "workers", "matmul", "orthogonalisation")
AS_BEFORE = {("optimizer", "iterations"): "five"}  # a later key, and the value at which a run is what it was without it


def identity(settings: Mapping[str, Any], **shape: str) -> dict[str, Any]:
    """Everything that decides a run's numbers, and nothing that does not.

    Args:
        settings: The resolved config.
        **shape: What identifies the ground truth.
    """
    numbers = {name: settings[name] for name in NUMBERS}
    for group in ("trainer", "data"):
        numbers[group] = {key: value for key, value in numbers[group].items() if key not in MACHINE}
    for (group, key), before in AS_BEFORE.items():
        if numbers[group].get(key) == before:
            numbers[group] = {name: value for name, value in numbers[group].items() if name != key}
    data = numbers["data"]
    if data.get("region_points") == 0:  # without such points their share decides nothing
        counts = {key: value for key, value in data["counts"].items() if key != "regions"}
        numbers["data"] = {key: value for key, value in data.items() if key != "region_points"} | {"counts": counts}
    return numbers | {"shape": shape}


def finished_row(folder: Path, numbers: Mapping[str, Any], *, force: bool, reuse: bool) -> ResultRow | None:
    """The row of this very run, if the folder holds it already, undamaged; nothing is written.

    Args:
        folder: The run folder; need not be there.
        numbers: From `identity`.
        force: Whether what the folder holds does not matter.
        reuse: Whether a row taken from another study will do.

    Raises:
        InputError: The folder holds a checkpoint or result of another config (the differing keys are listed), or a
            damaged config.
    """
    if force or not ((folder / ROW_FILE).exists() or (folder / CHECKPOINT).exists()):
        return None
    if not (folder / CONFIG).is_file():
        raise InputError(f"{folder} holds a run without its {CONFIG}; force=true starts it over")
    _refuse_another(folder, read_config(folder)["identity"], numbers)
    try:
        row = read_row(folder / ROW_FILE)
    except (FileNotFoundError, ValueError):  # `claim` reports a damaged one
        return None
    return row if reuse or REUSED not in row.provenance else None


def claim(folder: Path, settings: Mapping[str, Any], numbers: Mapping[str, Any], *, resume: str, force: bool) -> None:
    """Make the folder this run's: write its config there.

    Without a checkpoint to go on from, whatever an earlier attempt left is removed. A damaged result is reported.

    Args:
        folder: The run folder, for which `finished_row` gave None; made where it is not there.
        settings: The resolved config, stored as `config.yaml`.
        numbers: From `identity`.
        resume: `auto` keeps the folder's checkpoint, `never` does not.
        force: Whether to throw away what the folder holds.
    """
    if not force and (folder / ROW_FILE).exists():
        try:
            read_row(folder / ROW_FILE)
        except ValueError as error:
            log.warning("%s; the run is done again", error)
    if folder.is_dir() and (force or resume == "never" or not (folder / CHECKPOINT).exists()):
        _clear(folder)
    write_atomically(folder / CONFIG, yaml.safe_dump({**settings, "identity": dict(numbers)}, sort_keys=False))


def read_config(folder: Path) -> dict[str, Any]:
    """The config that a run folder holds.

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


def stored_row(folder: Path) -> ResultRow:
    """The row that a run folder holds.

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
    """Empty the folder but for what says that this process works on it."""
    for entry in folder.iterdir():
        if entry.is_dir() and not entry.is_symlink():
            shutil.rmtree(entry)
        elif entry.name not in (LOCK, STATUS):
            entry.unlink()


def _refuse_another(folder: Path, held: Mapping[str, Any], wanted: Mapping[str, Any]) -> None:
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
