"""Settings of cloud, pool and steps from the config's group `data`."""

from omegaconf import DictConfig

from jointsdf.data.corruption import Corruption
from jointsdf.data.sample_settings import SampleSettings
from jointsdf.data.sampler import Counts
from jointsdf.data.scanner import Scanner
from jointsdf.errors import require_integer
from jointsdf.experiment.settings import resolve


def counts(cfg: DictConfig) -> Counts:
    """Numbers of points of one step."""
    return Counts(**resolve(cfg.data.counts))


def sample_settings(cfg: DictConfig) -> SampleSettings:
    """Settings of cloud and pool; no pool where no term uses it.

    Raises:
        InputError: A value out of range.
    """
    settings = {key: value for key, value in resolve(cfg.data).items() if key not in ("counts", "workers")}
    if cfg.loss.weights.get("signed_distance", 0) == 0:
        settings["pool_size"] = 0
    else:
        require_integer("data.pool_size", cfg.data.pool_size, 1)  # a mean over no points is not finite
    corruption = settings.pop("corruption")
    scanner = Scanner(**corruption.pop("scanner"))
    return SampleSettings(**settings, corruption=Corruption(scanner, **corruption))
