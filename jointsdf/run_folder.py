"""The folder of one run: which config it holds, and whether another may have it."""

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from jointsdf.results import write_atomically
from jointsdf.values import InputError

# What decides the numbers of a run; everything else in the config is where and how it runs.
NUMBERS = ("seed", "data", "trunk", "head", "loss", "optimizer", "trainer", "extraction", "evaluation")
MACHINE = ("accelerator", "checkpoint_seconds", "log_every", "preview_every", "preview_resolution", "workers")


def identity(settings: Mapping[str, Any], **shape: str) -> dict[str, Any]:
    """Everything that decides a run's numbers, and nothing that does not.

    Args:
        settings: The resolved config.
        **shape: What identifies the ground truth.
    """
    numbers = {name: settings[name] for name in NUMBERS}
    for group in ("trainer", "data"):
        numbers[group] = {key: value for key, value in numbers[group].items() if key not in MACHINE}
    return numbers | {"shape": shape}


def claim(
    folder: Path, settings: Mapping[str, Any], numbers: Mapping[str, Any], *, resume: str, force: bool
) -> None:
    """Make the folder this run's: write its config there, or refuse.

    Args:
        folder: The run folder; made where it is not there.
        settings: The resolved config, stored as `config.yaml`.
        numbers: From `identity`.
        resume: `auto` keeps the folder's checkpoint, `never` deletes it.
        force: Whether to throw away what the folder holds.

    Raises:
        InputError: The folder holds another config and `force` is not set; the differing keys are listed.
    """
    if resume not in ("auto", "never"):
        raise InputError(f"resume={resume}: accepted are auto, never")
    if force and folder.is_dir():
        shutil.rmtree(folder)
    stored = folder / "config.yaml"
    if stored.is_file():
        _refuse_another(folder, _flat(read_config(folder)["identity"]), _flat(numbers))
    folder.mkdir(parents=True, exist_ok=True)
    if resume == "never":
        (folder / "last.ckpt").unlink(missing_ok=True)
    write_atomically(stored, yaml.safe_dump({**settings, "identity": dict(numbers)}, sort_keys=False))


def read_config(folder: Path) -> dict[str, Any]:
    """The config that a run folder holds.

    Raises:
        InputError: There is none, or it cannot be read.
    """
    path = folder / "config.yaml"
    if not path.is_file():
        raise InputError(f"{folder}: not a run folder (no config.yaml); give one that train.py made")
    try:
        config: dict[str, Any] = yaml.safe_load(path.read_text())
        config["identity"]
    except (yaml.YAMLError, TypeError, KeyError) as error:
        raise InputError(f"{path}: damaged; force=true starts the run over") from error
    return config


def _refuse_another(folder: Path, before: Mapping[str, Any], now: Mapping[str, Any]) -> None:
    differing = sorted(key for key in before.keys() | now.keys() if before.get(key) != now.get(key))
    if differing:
        listed = ", ".join(f"{key} ({before.get(key)} -> {now.get(key)})" for key in differing)
        raise InputError(f"{folder} holds another config: {listed}; variant=<name> makes a new folder, force=true overwrites")


def _flat(tree: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    leaves: dict[str, Any] = {}
    for key, value in tree.items():
        leaves |= _flat(value, f"{prefix}{key}.") if isinstance(value, Mapping) else {f"{prefix}{key}": value}
    return leaves
