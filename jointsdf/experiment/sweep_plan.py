"""Plan of a sweep before its first run: files of `shapes=`, run folders, and the runs that are finished already."""

import logging
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from omegaconf import DictConfig

from jointsdf.experiment.quoting import escape_interpolations
from jointsdf.experiment.settings import folder_of
from jointsdf.experiment.sweep_configs import expand_shapes, launch_one_by_one, set_shapes, sweep_configs
from jointsdf.runs import status

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Plan:
    """Runs of a sweep.

    Attributes:
        folders: Folder of every wanted run, finished or not; one for each run.
        finished: Finished runs that Hydra leaves out: a config that they share, and their own plain values of it.
    """

    folders: list[Path]
    finished: list[tuple[DictConfig, dict[str, Any]]] = field(default_factory=list)


def plan_sweep(config: DictConfig) -> Plan:
    """Fix the runs that Hydra makes, and in which order.

    Of a sweep over files, parts whose runs are all finished are left out, so that what is left to do begins at once;
    whether they are still runs of the same config is for the caller to check afterwards.

    Args:
        config: The sweep's own config, with Hydra's node; changed in place.

    Raises:
        InputError: `shapes` names no files.
    """
    over_files = expand_shapes(config)
    launch_one_by_one(config)
    if not over_files:
        return Plan([folder_of(cfg) for cfg in sweep_configs(config)])
    shape_of: dict[Path, str] = {}  # run folder -> file
    runs: dict[str, list[tuple[DictConfig, dict[str, Any]]]] = {}  # file -> its runs
    twins: dict[str, str] = {}  # file -> another one with the same folders
    left: set[str] = set()  # files with a run that is not finished
    for cfg in sweep_configs(config):
        folder, shape = folder_of(cfg), str(cfg.shape)
        if (first := shape_of.setdefault(folder, shape)) != shape:
            twins[shape] = first
            continue
        runs.setdefault(shape, []).append((cfg, {"shape": escape_interpolations(shape), "seed": cfg.seed}))
        if cfg.force or status.read_state(folder).kind != "done":
            left.add(shape)
    for shape, first in twins.items():
        log.warning("passed over: %s has name and content of %s; rename it to have runs of its own", shape, first)
    launched = [shape for shape in runs if shape in left] or list(runs)[-1:]  # Hydra makes one at least
    set_shapes(config, launched)
    return Plan(list(shape_of), [run for shape in runs if shape not in launched for run in runs[shape]])
