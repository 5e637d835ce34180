"""Measure a finished run again: `python evaluate.py run=outputs/fast/base/siren/part_01/seed0`."""

import logging
import sys
from pathlib import Path

import hydra
from omegaconf import DictConfig, OmegaConf

from jointsdf.cli_logging import quiet_libraries, user_errors
from jointsdf.errors import InputError
from jointsdf.phases import phase

log = logging.getLogger("jointsdf")
failed: list[str] = []


@hydra.main(config_path="conf", config_name="evaluate", version_base="1.3")
def evaluate(cfg: DictConfig) -> None:
    """Print every score as measured now, and as stored where it differs."""
    with user_errors(failed):
        quiet_libraries()
        with phase("start", "torch and lightning"):
            from jointsdf.experiment.run import measure_again
        quiet_libraries()  # those that came with it as well
        if OmegaConf.is_missing(cfg, "run"):
            raise InputError("run= is missing; give a finished run's folder: run=outputs/fast/base/siren/part_01/seed0")
        row, scores = measure_again(Path(str(cfg.run)))
        differing = 0
        for protocol, values in scores.items():
            for name, value in values.items():
                stored = row.scores.get(protocol, {}).get(name, float("nan"))
                same = stored == value or (stored != stored and value != value)
                differing += not same
                log.info("%-8s %-22s %12.6f%s", protocol, name, value, "" if same else f"   stored {stored:.6f}")
        log.info("%s: %s", cfg.run, f"{differing} scores differ" if differing else "every score as stored")


if __name__ == "__main__":
    evaluate()
    sys.exit(2 if failed else 0)
