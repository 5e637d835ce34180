"""Configs of a sweep's runs, composed as Hydra's basic sweeper composes them."""

from functools import cache
from typing import Any

from hydra import compose
from hydra._internal.core_plugins.basic_sweeper import BasicSweeper
from hydra.core.global_hydra import GlobalHydra
from hydra.core.override_parser.overrides_parser import OverridesParser
from omegaconf import DictConfig

PLAIN_KEYS = ("shape", "seed")  # values on which nothing else in a config depends


def sweep_configs(config: DictConfig) -> list[DictConfig]:
    """Config of each run in the sweeper's order, with all values that decide its folder.

    Args:
        config: The sweep's own config, with Hydra's node.
    """
    given = [f"{key}={value}" for key, value in (config.hydra.sweeper.get("params") or {}).items()]
    given += config.hydra.overrides.task  # later ones replace earlier ones: the command line narrows a stored sweep
    parser = OverridesParser.create(config_loader=GlobalHydra.instance().config_loader())
    (jobs,) = BasicSweeper.split_arguments(parser.parse_overrides(given), None)
    compose_once = cache(lambda *overrides: compose(config.hydra.job.config_name, list(overrides)))
    configs = []
    for job in jobs:
        plain = {key: value for key, value in map(_parse, job) if key in PLAIN_KEYS}
        cfg = compose_once(*(override for override in job if _parse(override)[0] not in PLAIN_KEYS)).copy()
        cfg.update(plain)
        configs.append(cfg)
    return configs


def _parse(override: str) -> tuple[str, Any]:
    """Key and value of an override."""
    parsed = OverridesParser.create().parse_override(override)
    return parsed.get_key_element(), parsed.value()
