"""`python -m benchmarks peers [OVERRIDES] [--only PEER ...]`: rows of classical peers beside those of runs.

OVERRIDES are those of `train.py`, whose run's cloud is reconstructed (recipe=points unless given); several values of a
key, as in shape=abc_0001,abc_0016, are several runs. The rows are in outputs/<study>/<variant>/<peer>/<shape>/seed<n>.
"""

import argparse
import logging
import math
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from hydra import compose, initialize_config_dir
from hydra._internal.core_plugins.basic_sweeper import BasicSweeper
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.errors import HydraException
from omegaconf import DictConfig
from omegaconf.errors import OmegaConfBaseException

from benchmarks.peers import libraries
from benchmarks.peers.rows import PEERS, Peer, peer_rows
from jointsdf.cli_logging import configure_logging, user_errors
from jointsdf.errors import InputError, first_line
from jointsdf.runs.row import ResultRow, score_of

CONF = Path(__file__).parents[2] / "conf"
SHOWN = ("cd_l1", "surface_p99", "nc", "euler", "euler_gt", "miou_exact", "boundary_f1_fine")
log = logging.getLogger("jointsdf")


def main(arguments: Sequence[str]) -> int:
    """Make the rows, and log one line for each; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks peers", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("overrides", nargs="*", help="key=value, as of train.py")
    parser.add_argument("--only", nargs="+", choices=PEERS, default=list(PEERS), metavar="PEER", help=", ".join(PEERS))
    chosen = parser.parse_args(arguments)
    configure_logging()
    failed: list[str] = []
    with user_errors(failed):
        peers = [PEERS[name] for name in chosen.only]
        require_libraries(peers)
        for cfg in configs(chosen.overrides):
            for row in peer_rows(cfg, peers):
                log.info(line(row, cfg.evaluation.primary))
    return 2 if failed else 0


def require_libraries(peers: Sequence[Peer]) -> None:
    """Import what the peers need, before anything is drawn or written.

    Raises:
        InputError: One is missing.
    """
    libraries.open3d()
    if any(peer.orientation == "meshlab" for peer in peers):
        libraries.pymeshlab()
    if any(peer.labels == "cut" for peer in peers):
        libraries.maxflow()


def configs(overrides: Sequence[str]) -> Iterator[DictConfig]:
    """Compose the config of each run that the overrides name; study `peers` unless given.

    Raises:
        InputError: An override that no config has, or that cannot be parsed.
    """
    with initialize_config_dir(str(CONF), version_base="1.3"):
        try:
            defaults = ("recipe=points", "study=peers")
            parsed = OverridesParser.create().parse_overrides([*defaults, *overrides])
            (jobs,) = BasicSweeper.split_arguments(parsed, None)
            for job in jobs:
                yield compose("config", list(job))
        except (HydraException, OmegaConfBaseException) as error:
            raise InputError(f"{' '.join(overrides)}: {first_line(error)}; see python train.py --help") from error


def line(row: ResultRow, protocol: str) -> str:
    """The row's scores in one line."""
    found = {name: score_of(row, protocol, name) for name in SHOWN}
    scores = ", ".join(f"{name} {value:.4g}" for name, value in found.items() if not math.isnan(value))
    return f"{row.shape} {row.head} ({row.variant}): {scores or row.status}; {row.seconds['total']:.0f} s"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
