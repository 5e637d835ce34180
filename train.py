"""Fit, extract and measure: `python train.py head=siren shape=abc_0001`; several at once with `-m`."""

import sys

import hydra
from omegaconf import DictConfig

from jointsdf.console import quiet_libraries, user_errors

failed: list[str] = []


@hydra.main(config_path="conf", config_name="config", version_base="1.3")
def train(cfg: DictConfig) -> float | None:
    """One run; the primary protocol's cd_l1 is what a sweeper sees."""
    with user_errors(failed):
        from jointsdf.experiment import run  # torch and lightning only after Hydra has accepted the command line

        quiet_libraries()
        return run(cfg).scores[cfg.evaluation.primary]["cd_l1"]
    return None


if __name__ == "__main__":
    train()
    sys.exit(2 if failed else 0)
