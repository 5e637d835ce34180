"""Command line of the figures: `python -m jointsdf.figures [outputs]` writes OUTPUTS/figures/<study>/*.pdf ..."""

import argparse
import logging
import sys
from collections.abc import Callable, Collection, Iterator, Sequence
from pathlib import Path

from jointsdf.cli_logging import program_name
from jointsdf.runs.records import DEFAULT_PROTOCOL
from jointsdf.runs.row import ResultRow
from jointsdf.runs.trusted_targets import TRUST_HELP, trusted_names
from jointsdf.study.__main__ import add_all, add_folders, add_heads
from jointsdf.study.collect import collect, load_rows
from jointsdf.study.families import groups_with_own_tables, join_variants
from jointsdf.study.figures.loss_curves import loss_curves
from jointsdf.study.figures.plots import PLOTS
from jointsdf.study.figures.renderings import failures, triptychs
from jointsdf.study.figures.style import ENDINGS, Drawing, write_drawing
from jointsdf.study.groups import Group, group_runs
from jointsdf.study.missing_runs import find_missing_runs
from jointsdf.study.tables.write import FIGURES, remove_old

log = logging.getLogger("jointsdf.study.figures")

FROM_RUN_FOLDERS: dict[str, Callable[[Group, Path, Collection[str]], tuple[Drawing | None, list[str]]]] = {
    "triptychs": triptychs,
    "failures": failures,
    "loss_curves": lambda group, outputs, _: loss_curves(group, outputs),
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns the exit code, 2 for an error that the user can fix."""
    parser = argparse.ArgumentParser(prog=program_name("jointsdf.figures"), description="Figures of the runs.")
    add_folders(parser)
    add_heads(parser)
    add_all(parser)
    parser.add_argument("--trust", metavar="MODULE", action="append", help=TRUST_HELP)
    options = parser.parse_args(arguments)
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    logging.getLogger("fontTools").setLevel(logging.WARNING)
    try:
        rows, passed_over = load_rows(options.outputs, options.results, options.heads, every_study=options.all)
        for path in write_figures(rows, options.outputs, options.heads, trusted_names(options.trust), passed_over):
            log.info(path)
    except (ValueError, OSError) as error:
        log.error(error)
        return 2
    return 0


def write_figures(
    rows: Sequence[ResultRow],
    outputs: Path,
    heads: Collection[str] | None = None,
    trust: Collection[str] = (),
    passed_over: int = 0,
) -> list[Path]:
    """Write every figure of every group of at least two runs; delete the figures of groups that are gone.

    A figure of files in run folders shows the runs that have them; missing ones are logged, one line per figure.

    Args:
        rows: Result rows.
        outputs: Folder of the studies; the figures go to its `figures/<study>/`.
        heads: The heads that the rows were selected by; None for all.
        trust: Modules whose classes a run folder's config may name.
        passed_over: Number of files that `load_rows` passed over.

    Raises:
        OSError: The folder cannot be written.
    """
    folder = outputs / FIGURES
    written: list[Path] = []
    groups = group_runs(collect(rows), find_missing_runs(outputs, rows, heads), passed_over)
    for group in groups_with_own_tables(groups, join_variants(groups)):
        if len(group.runs) > 1:
            for name, drawing in _drawings(group, outputs, trust):
                written += write_drawing(drawing, folder / group.folder / (name + group.suffix), group.label(name))
    remove_old(folder, (*PLOTS, *FROM_RUN_FOLDERS), ENDINGS, written)
    return written


def _drawings(group: Group, outputs: Path, trust: Collection[str]) -> Iterator[tuple[str, Drawing]]:
    for name, plot in PLOTS.items():
        if drawing := plot(group):
            yield name, drawing
    if group.key["protocol"] != DEFAULT_PROTOCOL:
        return  # the same run folders as the default protocol's
    for name, picture in FROM_RUN_FOLDERS.items():
        drawing, missing = picture(group, outputs, trust)
        if missing:
            log.warning(f"{group.label(name)}: without {len(missing)} run folders, the first: {missing[0]}")
        if drawing:
            yield name, drawing


if __name__ == "__main__":
    sys.exit(main())
