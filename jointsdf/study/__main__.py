"""Command line of the studies: `python -m jointsdf.study tables [outputs]`."""

import argparse
import logging
import sys
from collections.abc import Sequence
from pathlib import Path

from jointsdf.study.tables import write_tables

log = logging.getLogger("jointsdf.study")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit code, 2 for what the user can mend."""
    parser = argparse.ArgumentParser(prog="python -m jointsdf.study", description="Tables from result rows.")
    commands = parser.add_subparsers(dest="command", required=True)
    tables = commands.add_parser("tables", help="write OUTPUTS/tables/*.csv and *.tex")
    tables.add_argument("outputs", nargs="?", type=Path, default=Path("outputs"), help="folder of the runs (outputs)")
    options = parser.parse_args(arguments)
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    try:
        for path in write_tables(options.outputs):
            log.info(path)
    except (ValueError, OSError) as error:
        log.error(error)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
