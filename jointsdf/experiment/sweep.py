"""A Hydra sweep in which a failed run does not stop the others, with a summary of all runs at the end.

Every engine (this process, Ray, SLURM) calls `run_one` for each run. The state of the runs is read from their folders,
so that it does not matter which process made a run, or died of it.
"""

import gc
import logging
import time
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from hydra.experimental.callback import Callback
from omegaconf import DictConfig

from jointsdf.cli_logging import configure_logging, log_levels, one_line
from jointsdf.errors import InputError
from jointsdf.phases import phase, run_named
from jointsdf.runs import status
from jointsdf.runs.folder import FIELD
from jointsdf.runs.lock import Busy
from jointsdf.runs.plan import plan, planned_runs
from jointsdf.runs.row import ROW_FILE, score_of

log = logging.getLogger(__name__)

RUN_LOGGERS = (  # of lines about a single run, which a sweep leaves out
    "jointsdf.experiment.existing_row",
    "jointsdf.experiment.run",
    "jointsdf.shapes.mesh_report",
    "jointsdf.training.product_choice",
    "jointsdf.phases",
)
STUDY_LEVEL = 3  # index of the study's folder among the parents of a run folder


@dataclass
class ActiveSweep:
    """The sweep that this process drives; a process that works for another one's sweep has an empty one.

    Attributes:
        wanted: Run folders in the order of the runs, each with its row's file at the start (`_row_file`).
        started: Start, monotonic seconds.
        postponed: Configs of runs that another process works on.
        finished: Runs that were finished before, as in `sweep_plan.Plan`.
    """

    wanted: dict[Path, tuple[int, int] | None] = field(default_factory=dict)
    started: float = field(default_factory=time.monotonic)
    postponed: list[DictConfig] = field(default_factory=list)
    finished: list[tuple[DictConfig, dict[str, Any]]] = field(default_factory=list)


active_sweep = ActiveSweep()


class Sweep(Callback):
    """Records the runs of a sweep when Hydra starts it. It has no state, since Hydra pickles it for other processes."""

    def on_multirun_start(self, config: DictConfig, **_: Any) -> None:
        """Record the wanted runs, in the study's folder as well.

        Raises:
            SystemExit: The chosen engine is not installed, or `shapes=` names no files.
        """
        global active_sweep
        configure_logging()
        with phase("start", "torch and lightning, then the runs of the sweep"):
            from jointsdf.experiment.sweep_plan import plan_sweep  # imports torch now
        configure_logging()  # loggers that came with it as well
        _check_engine(config)
        try:
            planned = plan_sweep(config)
        except InputError as error:
            log.error("error: %s", error)
            raise SystemExit(2) from error
        active_sweep = ActiveSweep({folder: _row_file(folder) for folder in planned.folders}, finished=planned.finished)
        for study in {folder.parents[STUDY_LEVEL] for folder in active_sweep.wanted}:
            plan(study, [folder for folder in active_sweep.wanted if folder.parents[STUDY_LEVEL] == study])
        if len(active_sweep.wanted) < len(planned.folders):
            what = f"{len(planned.folders)} runs share {len(active_sweep.wanted)} folders"
            log.warning("%s: name what differs in variant=, e.g. 'variant=tap=${trunk.tap}'", what)
        done = Counter(status.read_state(folder).kind for folder in active_sweep.wanted)["done"]
        log.info("%d runs wanted, %d of them finished before", len(active_sweep.wanted), done)


def run_one(cfg: DictConfig, *, wait_for_others: bool = False) -> float | None:
    """Make one run of a sweep.

    Args:
        cfg: The run's config.
        wait_for_others: Whether to wait for another process that works on this run, as a process that drives no sweep
            always does.

    Returns:
        The primary protocol's cd_l1; None where the run failed or another process works on it.
    """
    from jointsdf.experiment import build, run
    from jointsdf.experiment.settings import folder_of
    from jointsdf.experiment.summary import summary

    folder = before = None
    try:
        build.check_config(cfg)
        folder = folder_of(cfg)
        before = status.read_state(folder)
        if before.killed_twice:
            raise InputError(f"its process was killed twice at step {before.step}: is memory short?")
        with log_levels(dict.fromkeys(RUN_LOGGERS, logging.ERROR)), run_named(f"{cfg.head.name} {cfg.shape}"):
            row = run.run(cfg, wait=wait_for_others or not active_sweep.wanted)
    except Busy:
        log.info("%s: another process works on it; it is tried again at the end", folder)
        active_sweep.postponed.append(cfg)
        return None
    except Exception as error:  # the other runs go on, whatever it is
        message = one_line(error) or f"{type(error).__name__}: {' '.join(str(error).split())}"
        place = "/".join(folder.parts[-4:]) + ": " if folder else ""
        log.error("error: %s%s", place, message)
        if folder:
            status.fail(folder, message, error)
        return None
    finally:
        if cfg.force or before is None or before.kind != "done":  # a row that was there took little memory
            gc.collect()  # the next run needs it
    if before.kind != "done":
        log.info("%s %s", _progress(folder), summary(row, cfg.evaluation.primary, folder))
    return score_of(row, cfg.evaluation.primary, "cd_l1")


def wait_for_postponed() -> None:
    """Check the runs that were finished before, and make those that other processes worked on and left unfinished."""
    for cfg, values in active_sweep.finished:
        cfg.update(values)
        run_one(cfg, wait_for_others=True)
    for cfg in active_sweep.postponed:
        run_one(cfg, wait_for_others=True)


def sum_up() -> int:
    """Log the state of the wanted runs, and end the sweep.

    Returns:
        Number of runs that are not finished; 0 without a sweep.
    """
    global active_sweep
    sweep, active_sweep = active_sweep, ActiveSweep()
    if not sweep.wanted:
        return 0
    kinds: Counter[str] = Counter()
    for folder in sweep.wanted:
        state = status.read_state(folder)
        kinds[state.kind] += 1
        if state.kind == "failed":
            log.error("failed: %s: %s", folder, state.error)
    new = sum(_is_new(folder, row) for folder, row in sweep.wanted.items())
    missing = kinds["missing"] + kinds["stopped"]
    running = f", {kinds['running']} running elsewhere" if kinds["running"] else ""
    counts = f"{new} done, {kinds['done'] - new} skipped, {kinds['failed']} failed, {missing} missing{running}"
    log.info("%d runs: %s", len(sweep.wanted), counts)
    return len(sweep.wanted) - kinds["done"]


def _check_engine(config: DictConfig) -> None:
    try:
        launcher = find_spec(config.hydra.launcher._target_.rpartition(".")[0])
    except ModuleNotFoundError:
        launcher = None
    if launcher is None:
        engine = config.hydra.runtime.choices["hydra/launcher"]
        log.error("error: hydra/launcher=%s is not installed: pip install '.[%s]'", engine, engine)
        raise SystemExit(2)


def _progress(folder: Path) -> str:
    """Progress of the sweep, e.g. `[12/200, 1 failed, 3:10 h left]`; no time left in a process that drives no sweep."""
    wanted = active_sweep.wanted or planned_runs(folder.parents[STUDY_LEVEL])
    kinds = Counter(status.read_state(folder).kind for folder in wanted)
    new = sum(_is_new(folder, row) for folder, row in active_sweep.wanted.items())
    unfinished = len(wanted) - kinds["done"] - kinds["failed"]
    parts = [f"{kinds['done']}/{len(wanted)}"]
    parts += [f"{kinds['failed']} failed"] if kinds["failed"] else []
    if new and unfinished:
        parts += [f"{status.duration((time.monotonic() - active_sweep.started) / new * unfinished)} left"]
    return f"[{', '.join(parts)}]"


def _row_file(folder: Path) -> tuple[int, int] | None:
    """Identity of the folder's row, which is replaced as a whole; no clock tells its age, since one may be set back."""
    with suppress(OSError):
        return (found := (folder / ROW_FILE).stat()).st_ino, found.st_mtime_ns
    return None


def _is_new(folder: Path, before: tuple[int, int] | None) -> bool:
    """True if the folder's row is another than before; a row copied from another study comes without a field."""
    return (folder / FIELD).is_file() and _row_file(folder) not in (None, before)
