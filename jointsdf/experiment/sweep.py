"""A sweep of Hydra's that survives: a run that fails costs itself only, and the end says how all of them stand.

Every engine (this process, Ray, SLURM) calls `run_one` for each run. What became of it is read from the run folders, so
that it does not matter which process did it, or died of it.
"""

import gc
import logging
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from hydra import compose
from hydra._internal.core_plugins.basic_sweeper import BasicSweeper
from hydra.core.global_hydra import GlobalHydra
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.experimental.callback import Callback
from omegaconf import DictConfig

from jointsdf.cli_logging import one_line, quiet_libraries
from jointsdf.errors import InputError
from jointsdf.phases import phase, run_named
from jointsdf.runs import status
from jointsdf.runs.folder import FIELD
from jointsdf.runs.lock import Busy
from jointsdf.runs.row import ROW_FILE

log = logging.getLogger(__name__)

SPEAKS_OF_ONE_RUN = (
    "jointsdf.experiment.run",
    "jointsdf.shapes.mesh_report",
    "jointsdf.training.matrix_products",
    "jointsdf.phases",
)
PLAIN = ("shape", "seed")  # values on which nothing else in a config depends


@dataclass
class ActiveSweep:
    """The sweep that this process drives; nothing is wanted in one that only works for another.

    Attributes:
        wanted: Run folders, in the order of the runs.
        started: When, seconds since the epoch.
        postponed: Configs of runs that another process works on.
    """

    wanted: list[Path] = field(default_factory=list)
    started: float = field(default_factory=time.time)
    postponed: list[DictConfig] = field(default_factory=list)


active_sweep = ActiveSweep()


class Sweep(Callback):
    """Tells, when Hydra starts a sweep, which runs it wants. It has no state: Hydra hands it on to other processes."""

    def on_multirun_start(self, config: DictConfig, **_: Any) -> None:
        """Note the wanted runs, on disk as well.

        Raises:
            SystemExit: The chosen engine is not installed.
        """
        global active_sweep
        quiet_libraries()
        with phase("start", "torch and lightning, then the runs of the sweep"):
            from jointsdf.experiment.build import folder_of
        quiet_libraries()  # those that came with it as well
        _check_engine(config)
        folders = [folder_of(cfg) for cfg in _wanted_configs(config)]
        active_sweep = ActiveSweep(list(dict.fromkeys(folders)))
        for study in {folder.parents[3] for folder in active_sweep.wanted}:
            status.plan(study, [folder for folder in active_sweep.wanted if folder.parents[3] == study])
        if len(active_sweep.wanted) < len(folders):
            what = f"{len(folders)} runs share {len(active_sweep.wanted)} folders"
            log.warning("%s: name what differs in variant=, e.g. 'variant=tap=${trunk.tap}'", what)
        done = Counter(status.read_state(folder).kind for folder in active_sweep.wanted)["done"]
        log.info("%d runs wanted, %d of them finished before", len(active_sweep.wanted), done)


def run_one(cfg: DictConfig, *, wait_for_others: bool = False) -> float | None:
    """One run of a sweep: its cd_l1, None where it failed or another process works on it.

    Args:
        cfg: The run's config.
        wait_for_others: Whether to wait for another process that works on this run, as a process that drives no sweep
            always does.
    """
    from jointsdf.experiment import build, run
    from jointsdf.experiment.summary import summary

    folder = None
    try:
        build.check_config(cfg)
        folder = build.folder_of(cfg)
        before = status.read_state(folder)
        if before.killed_twice:
            raise InputError(f"its process was killed twice at step {before.step}: is memory short?")
        with _quiet(), run_named(f"{cfg.head.name} {cfg.shape}"):
            row = run.run(cfg, wait=wait_for_others or not active_sweep.wanted)
    except Busy:
        log.info("%s: another process works on it; it is looked at again in the end", folder)
        active_sweep.postponed.append(cfg)
        return None
    except Exception as error:  # whatever it is, the other runs do not care
        message = one_line(error) or f"{type(error).__name__}: {' '.join(str(error).split())}"
        where = "/".join(folder.parts[-4:]) + ": " if folder else ""
        log.error("error: %s%s", where, message)
        if folder:
            status.fail(folder, message, error)
        return None
    finally:
        gc.collect()  # the next run needs the memory
    if before.kind != "done":
        log.info("%s %s", _progress(folder), summary(row, cfg.evaluation.primary, folder))
    return row.scores[cfg.evaluation.primary]["cd_l1"]


def wait_for_postponed() -> None:
    """Look again at the runs that other processes worked on: most are finished now, the others are done here."""
    for cfg in active_sweep.postponed:
        run_one(cfg, wait_for_others=True)


def sum_up() -> int:
    """Say how the wanted runs stand, and forget them.

    Returns:
        How many are not finished; 0 where no sweep was active_sweep.
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
    new = sum(_finished_since(folder, sweep.started) for folder in sweep.wanted)
    missing = kinds["missing"] + kinds["stopped"]
    running = f", {kinds['running']} running elsewhere" if kinds["running"] else ""
    counts = f"{new} done, {kinds['done'] - new} skipped, {kinds['failed']} failed, {missing} missing{running}"
    log.info("%d runs: %s", len(sweep.wanted), counts)
    return len(sweep.wanted) - kinds["done"]


def _wanted_configs(config: DictConfig) -> list[DictConfig]:
    """The config of each run as far as its folder goes, in the order in which Hydra's sweeper makes the runs."""
    given = [f"{key}={value}" for key, value in (config.hydra.sweeper.get("params") or {}).items()]
    given += config.hydra.overrides.task  # later ones replace earlier ones: the command line narrows a stored sweep
    parser = OverridesParser.create(config_loader=GlobalHydra.instance().config_loader())
    (jobs,) = BasicSweeper.split_arguments(parser.parse_overrides(given), None)
    composed = cache(lambda *overrides: compose(config.hydra.job.config_name, list(overrides)))
    configs = []
    for job in jobs:
        plain = {key: value for key, value in map(_parsed, job) if key in PLAIN}
        cfg = composed(*(override for override in job if _parsed(override)[0] not in PLAIN)).copy()
        cfg.update(plain)
        configs.append(cfg)
    return configs


def _parsed(override: str) -> tuple[str, Any]:
    found = OverridesParser.create().parse_override(override)
    return found.get_key_element(), found.value()


def _check_engine(config: DictConfig) -> None:
    try:
        there = find_spec(config.hydra.launcher._target_.rpartition(".")[0])
    except ModuleNotFoundError:
        there = None
    if there is None:
        engine = config.hydra.runtime.choices["hydra/launcher"]
        log.error("error: hydra/launcher=%s is not installed: pip install '.[%s]'", engine, engine)
        raise SystemExit(2)


@contextmanager
def _quiet() -> Iterator[None]:
    """Leave out what a single run says of itself."""
    before = {logger: logger.level for logger in map(logging.getLogger, SPEAKS_OF_ONE_RUN)}
    try:
        for logger in before:
            logger.setLevel(logging.ERROR)
        yield
    finally:
        for logger, level in before.items():
            logger.setLevel(level)


def _progress(folder: Path) -> str:
    """The sweep so far, e.g. `[12/200, 1 failed, 3:10 h left]`; without the time in a process that drives no sweep."""
    wanted = active_sweep.wanted or status.planned_runs(folder.parents[3])
    kinds = Counter(status.read_state(folder).kind for folder in wanted)
    new = sum(_finished_since(folder, active_sweep.started) for folder in active_sweep.wanted)
    open_ = len(wanted) - kinds["done"] - kinds["failed"]
    parts = [f"{kinds['done']}/{len(wanted)}"]
    parts += [f"{kinds['failed']} failed"] if kinds["failed"] else []
    parts += [f"{status.duration((time.time() - active_sweep.started) / new * open_)} left"] if new and open_ else []
    return f"[{', '.join(parts)}]"


def _finished_since(folder: Path, moment: float) -> bool:
    """Whether the folder's row was made since then, here: a row taken from another study has no field beside it."""
    row = folder / ROW_FILE
    return (folder / FIELD).is_file() and row.is_file() and row.stat().st_mtime >= moment
