"""The result row of a run that need not be made: from its own folder, or from another study."""

import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from omegaconf import DictConfig

from jointsdf.experiment.settings import trusted
from jointsdf.experiment.summary import summary
from jointsdf.runs import folder as run_folder
from jointsdf.runs import status
from jointsdf.runs.lock import lock
from jointsdf.runs.reuse import find_reusable_row
from jointsdf.runs.row import ResultRow, config_hash, write_row

log = logging.getLogger(__name__)


def find_row(
    cfg: DictConfig, folder: Path, settings: Mapping[str, Any], fingerprint: Mapping[str, Any], unit: str, *, wait: bool
) -> ResultRow | None:
    """Find the run's row in its folder or, with `reuse`, in another study, whose row is copied into the folder.

    Args:
        cfg: The composed config.
        folder: The run folder.
        settings: From `resolve_settings`.
        fingerprint: From `resolve_settings`.
        unit: Of the shape, which decides no number.
        wait: Whether to wait for another process that works on the same run.

    Raises:
        Busy: Another process works on the same run, and `wait` is false.
        InputError: The folder holds another config, or a damaged one.
    """
    row = run_folder.finished_row(folder, fingerprint, force=cfg.force, reuse=cfg.reuse, trust=trusted(cfg))
    if row:
        log.info("%s holds this run's result already; force=true runs it again", folder)
        if (written := row.provenance.get("unit", unit)) != unit:
            log.warning("%s: its files are in %s, not %s; force=true writes them again", folder, written, unit)
        status.end(folder)
    elif cfg.reuse and not cfg.force:
        stored = Path(cfg.paths.outputs), Path(cfg.paths.results)
        row = find_reusable_row(config_hash(fingerprint), folder, *stored, recipe=str(cfg.recipe))
        if row:
            row = _copy_row(row, cfg, folder, settings, fingerprint, wait=wait)
    if row:
        log.info(summary(row, cfg.evaluation.primary, folder))
    return row


def _copy_row(
    row: ResultRow,
    cfg: DictConfig,
    folder: Path,
    settings: Mapping[str, Any],
    fingerprint: Mapping[str, Any],
    *,
    wait: bool,
) -> ResultRow:
    """Write a row of another study into the run folder; the run's own, made by a process that was waited for, stays."""
    with lock(folder, wait=wait):
        if own := run_folder.finished_row(folder, fingerprint, force=False, reuse=True, trust=trusted(cfg)):
            return own
        run_folder.claim(folder, settings, fingerprint, resume="never", force=False)
        write_row(folder, row)
        status.end(folder)
    log.info("%s: taken from %s; reuse=false runs it here", folder, row.provenance[run_folder.REUSED])
    return row
