"""Fit, extract and measure: `python train.py head=siren shape=abc_0001`; many at once with `-m` or `sweeps=main`."""

import sys
import warnings

import hydra
from hydra.core.hydra_config import HydraConfig
from hydra.types import RunMode
from omegaconf import DictConfig

from jointsdf.cli_logging import quiet_libraries, user_errors
from jointsdf.experiment import sweep
from jointsdf.phases import phase

failed: list[str] = []
warnings.filterwarnings("ignore", r"\s*'hydra/launcher/ray' is validated")  # by the plugin's schema: as it should


@hydra.main(config_path="conf", config_name="config", version_base="1.3")
def train(cfg: DictConfig) -> float | None:
    """One run; the primary protocol's cd_l1 is what a sweeper sees."""
    with user_errors(failed):
        quiet_libraries()
        with phase("start", "torch and lightning"):  # only after Hydra has accepted the command line
            from jointsdf.experiment.run import run
        quiet_libraries()
        if HydraConfig.get().mode is RunMode.MULTIRUN:
            return sweep.run_one(cfg)
        return run(cfg).scores[cfg.evaluation.primary]["cd_l1"]
    return None


def main() -> int:
    """Exit code: 2 for what the user can mend, 1 for a sweep that is not finished."""
    unfinished = 0
    try:
        with user_errors(failed):  # an engine that waits for other processes can be stopped, too
            train()
            sweep.wait_for_postponed()
    finally:
        unfinished = sweep.sum_up()
    return 2 if failed else min(unfinished, 1)


if __name__ == "__main__":
    sys.exit(main())
