"""Plan of a sweep before its first run: files of `shapes=`, run folders, and the parts that are finished already."""

import logging
from pathlib import Path

from omegaconf import DictConfig

from jointsdf.cli_logging import log_levels, one_line
from jointsdf.data.point_cloud import Cloud
from jointsdf.experiment import build
from jointsdf.experiment.settings import folder_of, resolve_settings
from jointsdf.experiment.sweep_configs import expand_shapes, launch_one_by_one, set_shapes, sweep_configs
from jointsdf.runs import status
from jointsdf.runs.folder import finished_row

log = logging.getLogger(__name__)


def plan_sweep(config: DictConfig) -> list[Path]:
    """Fix the runs that Hydra makes, and in which order.

    Of a sweep over files, parts whose runs are all finished are left out here: through Hydra's composition each would
    take half a second more.

    Args:
        config: The sweep's own config, with Hydra's node; changed in place.

    Returns:
        Folder of every wanted run, finished or not.

    Raises:
        InputError: `shapes` names no files.
    """
    over_files = expand_shapes(config)
    launch_one_by_one(config)
    if not over_files:
        return [folder_of(cfg) for cfg in sweep_configs(config)]
    shape_of: dict[Path, str] = {}  # run folder -> file
    left: dict[str, bool] = {}  # file -> whether a run of it is left to do
    twins: dict[str, str] = {}  # file -> another one with the same folders
    for cfg in sweep_configs(config):
        folder = folder_of(cfg)
        first = shape_of.setdefault(folder, cfg.shape)
        if first != cfg.shape:
            twins[cfg.shape] = first
        elif not left.get(cfg.shape):
            left[cfg.shape] = not _is_finished(cfg, folder)
    for shape, first in twins.items():
        log.warning("passed over: %s has name and content of %s; rename it to have runs of its own", shape, first)
    set_shapes(config, [shape for shape, to_do in left.items() if to_do] or list(left)[-1:])
    return list(shape_of)


def _is_finished(cfg: DictConfig, folder: Path) -> bool:
    """Whether the folder holds this very run's row; what cannot be used is reported by the run itself."""
    if cfg.force or status.read_state(folder).kind != "done":
        return False

    def draw_cloud() -> Cloud:
        return build.cloud_of(cfg, shape)

    try:
        with log_levels({"jointsdf": logging.ERROR}):
            build.check_config(cfg)
            shape = build.load_shape(cfg)
            _, fingerprint = resolve_settings(cfg, shape, build.trunk_rate(cfg, shape, draw_cloud))
            return finished_row(folder, fingerprint, force=False, reuse=cfg.reuse) is not None
    except Exception as error:
        if one_line(error) is None:
            raise
        return False
