"""Configs of a sweep's runs, composed as Hydra's basic sweeper composes them."""

from collections.abc import Iterator, Sequence
from functools import cache
from typing import Any

from hydra import compose
from hydra._internal.core_plugins.basic_sweeper import BasicSweeper
from hydra.core.global_hydra import GlobalHydra
from hydra.core.override_parser.overrides_parser import OverridesParser
from omegaconf import DictConfig, OmegaConf, open_dict, read_write

from jointsdf.errors import InputError
from jointsdf.experiment.part_files import list_part_files
from jointsdf.experiment.quoting import quote_path

PLAIN_KEYS = ("shape", "seed")  # values on which nothing else in a config depends
IN_PROCESS = "hydra._internal.core_plugins.basic_launcher.BasicLauncher"


def expand_shapes(config: DictConfig) -> bool:
    """Replace `shapes=` among the sweep's overrides by `shape=` with every file of it.

    Args:
        config: The sweep's own config, with Hydra's node; changed in place.

    Returns:
        Whether the sweep is over the files of `shapes=`.

    Raises:
        InputError: `shapes` is missing in the sweep over a folder, given beside `shape`, or names no file.
    """
    if config.shapes is None:
        if config.hydra.runtime.choices.get("sweeps") == "folder":
            raise InputError("sweeps=folder: give the folder, shapes=my_parts/")
        return False
    overrides = _task_overrides(config)
    if any(override.startswith("shape=") for override in overrides):
        raise InputError("shape= and shapes= are given: leave one of them out")
    given = config.shapes if isinstance(config.shapes, str) else [str(name) for name in config.shapes]
    set_shapes(config, [str(path) for path in list_part_files(given)])
    return True


def set_shapes(config: DictConfig, files: Sequence[str]) -> None:
    """Have the sweep make runs of these files, each with all its heads and variants before the next one."""
    others = [override for override in _task_overrides(config) if not override.startswith(("shape=", "shapes="))]
    shapes = f"shape={','.join(map(quote_path, files))}"
    with read_write(config), open_dict(config):
        config.hydra.overrides.task = [shapes, "shapes=null", *others]


def sweep_configs(config: DictConfig) -> Iterator[DictConfig]:
    """Config of each run in the sweeper's order, with all values that decide its folder.

    A config is valid until the next one is asked for, since runs that differ in plain keys alone share it.

    Args:
        config: The sweep's own config, with Hydra's node.
    """
    given = [f"{key}={value}" for key, value in (config.hydra.sweeper.get("params") or {}).items()]
    given += _task_overrides(config)  # later ones replace earlier ones: the command line narrows a stored sweep
    parser = OverridesParser.create(config_loader=GlobalHydra.instance().config_loader())
    (jobs,) = BasicSweeper.split_arguments(parser.parse_overrides(given), None)
    compose_once = cache(lambda *overrides: compose(config.hydra.job.config_name, list(overrides)))
    parse = cache(_parse)
    for job in jobs:
        plain = {key: value for key, value in map(parse, job) if key in PLAIN_KEYS}
        cfg = compose_once(*(override for override in job if parse(override)[0] not in PLAIN_KEYS))
        cfg.update(plain)
        yield cfg


def launch_one_by_one(config: DictConfig) -> None:
    """Have Hydra check each run of this process when its turn comes, since `sweep_configs` has composed all kinds.

    Otherwise it composes every run before it starts the first one, 0.1 s each.
    """
    if config.hydra.launcher._target_ == IN_PROCESS and config.hydra.sweeper.get("max_batch_size", 1) is None:
        with read_write(config), open_dict(config):
            config.hydra.sweeper.max_batch_size = 1


def _task_overrides(config: DictConfig) -> list[str]:
    """What the user gave, with its interpolations as they are."""
    overrides: Any = OmegaConf.to_container(config.hydra.overrides.task, resolve=False)
    return list(overrides)


def _parse(override: str) -> tuple[str, Any]:
    """Key and value of an override."""
    parsed = OverridesParser.create().parse_override(override)
    return parsed.get_key_element(), parsed.value()
