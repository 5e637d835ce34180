"""Command line that shows runs and studies in a browser: `jointsdf view RUN...`, `jointsdf view --study main`."""

import argparse
import logging
import sys
from collections.abc import Sequence
from pathlib import Path

from jointsdf.cli_logging import configure_logging, program_name, user_errors
from jointsdf.errors import InputError
from jointsdf.runs.trusted_targets import TRUST_HELP, trusted_names
from jointsdf.study.collect import load_rows
from jointsdf.study.page.study_page import PAGES, write_study_page
from jointsdf.viewing.page.stored_runs import view_runs

log = logging.getLogger("jointsdf.view")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns the exit code, 2 for an error that the user can correct."""
    parser = argparse.ArgumentParser(
        prog=program_name("jointsdf.study.page"),
        description="Write a page that shows runs of one shape, or a study, to anyone with a browser.",
    )
    parser.add_argument("runs", nargs="*", type=Path, metavar="RUN", help="folders of finished runs of one shape")
    parser.add_argument("--study", help="a study instead, e.g. main: its shapes by its heads")
    parser.add_argument(
        "--page", type=Path, help="file to write (RUN/report.html; view.html for several); of a study its folder"
    )
    parser.add_argument("--outputs", type=Path, default=Path("outputs"), help="folder of the studies (outputs)")
    parser.add_argument("--results", type=Path, default=Path("results"), help="folder of the committed rows (results)")
    parser.add_argument("--trust", metavar="MODULE", action="append", help=TRUST_HELP)
    options = parser.parse_args(arguments)
    configure_logging()
    failed: list[str] = []
    with user_errors(failed):
        log.info("open %s in a browser", _write(options))
    return 2 if failed else 0


def _write(options: argparse.Namespace) -> Path:
    trust = trusted_names(options.trust)
    if bool(options.runs) == bool(options.study):
        raise InputError("give folders of finished runs, e.g. outputs/fast/base/siren/part_01/seed0, or --study main")
    if options.runs:
        return view_runs(options.runs, options.page, trust)
    try:
        rows, _ = load_rows(options.outputs, options.results)
    except ValueError as error:
        raise InputError(str(error)) from error
    folder = options.page or options.outputs / PAGES / options.study
    return write_study_page(options.study, rows, options.outputs, folder, trust)


if __name__ == "__main__":
    sys.exit(main())
