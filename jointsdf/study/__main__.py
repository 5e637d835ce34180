"""Command line of the studies: `python -m jointsdf.study tables`, `report`, `status` and `results`."""

import argparse
import logging
import sys
from collections.abc import Sequence
from pathlib import Path

from jointsdf.cli_logging import program_name
from jointsdf.study.collect import load_rows
from jointsdf.study.commit import commit_rows
from jointsdf.study.document import compile_pdf
from jointsdf.study.groups import SUFFIX
from jointsdf.study.status import format_status
from jointsdf.study.tables.write import write_tables

log = logging.getLogger("jointsdf.study")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit code, 2 for an error that the user can fix."""
    options = _parser().parse_args(arguments)
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    try:
        _run(options)
    except (ValueError, OSError) as error:
        log.error(error)
        return 2
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=program_name("jointsdf.study"), description="Tables, status and committed rows of a study."
    )
    commands = parser.add_subparsers(dest="command", required=True)
    tables = commands.add_parser("tables", help="write OUTPUTS/tables/<study>/*.csv and *.tex")
    report = commands.add_parser(
        "report", help="write the tables and OUTPUTS/tables/report.pdf, with the figures there"
    )
    status = commands.add_parser("status", help="show the status of a study: a grid of heads by shapes")
    results = commands.add_parser("results", help="write a study's rows to RESULTS/<study>/runs.csv, to be committed")
    for command in (tables, report):
        add_heads(command)
        add_all(command)
    for command in (status, results):
        command.add_argument("study", help="its name, e.g. main")
    for command in (tables, report, status, results):
        add_folders(command)
    return parser


def _run(options: argparse.Namespace) -> None:
    if options.command == "status":
        log.info(format_status(options.outputs / options.study))
        return
    if options.command == "results":
        path, count, problems = commit_rows(options.outputs / options.study, options.results)
        log.info("\n".join([*problems, f"{path}: {count} runs"]))
        return
    rows, passed_over = load_rows(options.outputs, options.results, options.heads, every_study=options.all)
    written = write_tables(rows, options.outputs, options.results, options.heads, passed_over)
    if options.command == "report":
        written.append(compile_pdf(written[-1]))
    shown = [path for path in written if SUFFIX not in path.name]  # of each study the first group
    log.info("\n".join(map(str, shown)))
    if others := len(written) - len(shown):
        log.info(f"and {others} tables of other groups, named <table>{SUFFIX}<group>")


def add_heads(command: argparse.ArgumentParser) -> None:
    """Add the option that selects heads."""
    command.add_argument(
        "--heads",
        type=lambda text: [name.strip() for name in text.split(",")],
        help="these alone, e.g. siren,hybrid: on the shapes that they share",
    )


def add_all(command: argparse.ArgumentParser) -> None:
    """Add the option that selects committed studies."""
    said = "the committed studies as well; otherwise only those with finished runs below OUTPUTS, if there are any"
    command.add_argument("--all", action="store_true", help=said)


def add_folders(command: argparse.ArgumentParser) -> None:
    """Add the folders of runs and of committed rows."""
    command.add_argument("outputs", nargs="?", type=Path, default=Path("outputs"), help="folder of the runs (outputs)")
    command.add_argument(
        "--results", type=Path, default=Path("results"), help="folder of the committed rows and the paper's (results)"
    )


if __name__ == "__main__":
    sys.exit(main())
