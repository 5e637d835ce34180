"""Command line of the studies: `python -m jointsdf.study tables`, `report`, `status` and `results`."""

import argparse
import logging
import sys
from collections.abc import Sequence
from pathlib import Path

from jointsdf.study.collect import gather
from jointsdf.study.commit import commit_rows
from jointsdf.study.comparisons import SUFFIX
from jointsdf.study.document import compile_report
from jointsdf.study.status import status
from jointsdf.study.tables.write import write_tables

log = logging.getLogger("jointsdf.study")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit code, 2 for what the user can mend."""
    parser = argparse.ArgumentParser(prog="python -m jointsdf.study", description="Tables from result rows.")
    commands = parser.add_subparsers(dest="command", required=True)
    tables = commands.add_parser("tables", help="write OUTPUTS/tables/*.csv and *.tex")
    report = commands.add_parser(
        "report", help="write the tables and OUTPUTS/tables/report.pdf, with the figures there"
    )
    stand = commands.add_parser("status", help="show how the runs of a study stand: a grid of heads by shapes")
    keep = commands.add_parser("results", help="write a study's rows to RESULTS/<study>/runs.csv, to be committed")
    for command in (tables, report):
        add_heads(command)
    for command in (stand, keep):
        command.add_argument("study", help="its name, e.g. main")
    for command in (tables, report, stand, keep):
        add_folders(command)
    options = parser.parse_args(arguments)
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    try:
        if options.command == "status":
            log.info(status(options.outputs / options.study))
            return 0
        if options.command == "results":
            path, count, problems = commit_rows(options.outputs / options.study, options.results)
            log.info("\n".join([*problems, f"{path}: {count} runs"]))
            return 0
        rows = gather(options.outputs, options.results, options.heads)
        written = write_tables(rows, options.outputs, options.results, options.heads)
        if options.command == "report":
            written.append(compile_report(written[-1]))
        shown = [path for path in written if SUFFIX not in path.name]
        log.info("\n".join(map(str, shown)))
        if others := len(written) - len(shown):
            log.info(f"and {others} tables of other groups beside them, named <table>{SUFFIX}<group>")
    except (ValueError, OSError) as error:
        log.error(error)
        return 2
    return 0


def add_heads(command: argparse.ArgumentParser) -> None:
    """The heads that are looked at."""
    command.add_argument(
        "--heads",
        type=lambda text: [name.strip() for name in text.split(",")],
        help="these alone, e.g. siren,hybrid: on the shapes that they share",
    )


def add_folders(command: argparse.ArgumentParser) -> None:
    """The two folders that rows come from."""
    command.add_argument("outputs", nargs="?", type=Path, default=Path("outputs"), help="folder of the runs (outputs)")
    command.add_argument(
        "--results", type=Path, default=Path("results"), help="folder of the committed rows and the paper's (results)"
    )


if __name__ == "__main__":
    sys.exit(main())
