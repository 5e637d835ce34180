"""`python -m benchmarks.progress FOLDER RUN...`: how good runs on one shape were on their way, whatever their recipe.

From the previews in the TensorBoard logs of the run folders (`trainer.preview_every=100`): a coarse mesh each time, so
that the numbers compare runs with each other and not with results. Writes progress.csv and progress.png to FOLDER.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import pandas as pd

from jointsdf.errors import InputError
from jointsdf.runs.folder import BOARD, read_config, read_result
from jointsdf.study.figures.loss_curves import read_curves
from jointsdf.study.figures.style import MARKERS, PNG_DPI, STYLE, make_panels
from jointsdf.study.tables.columns import CD_L1, MIOU, NC
from jointsdf.viewing.palette import HEAD_COLOURS

SHOWN = (CD_L1, NC, MIOU)


def main(arguments: Sequence[str]) -> None:
    """Read the runs, write the table and the figure."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.progress", description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("runs", type=Path, nargs="+")
    chosen = parser.parse_args(arguments)
    try:
        found = pd.concat([progress(run) for run in chosen.runs])
    except InputError as error:
        sys.exit(str(error))
    chosen.folder.mkdir(parents=True, exist_ok=True)
    found.to_csv(chosen.folder / "progress.csv", index=False, float_format="%.6g")
    draw(found, chosen.folder / "progress.png")


def progress(run: Path) -> pd.DataFrame:
    """A run's previews: recipe, shape, step, seconds of the fit till then, and the coarse measures.

    Args:
        run: Folder of a finished run.

    Raises:
        InputError: The run is not finished, or was made without previews.
    """
    row = read_result(run)
    curves = read_curves(run / BOARD, f"preview_{read_config(run)['trainer']['preview_resolution']}/")
    if not curves:
        raise InputError(f"{run / BOARD}: no previews; trainer.preview_every=100 makes them")
    table = pd.DataFrame(curves).rename_axis("step").reset_index()
    seconds = (row.seconds["fit"] * table["step"] / row.steps).round(1)
    table.insert(1, "seconds", seconds)
    table.insert(0, "recipe", row.recipe)
    table.insert(1, "shape", row.shape)
    return table


def draw(found: pd.DataFrame, path: Path) -> None:
    """Each measure over the seconds of the fit, a line per recipe."""
    with mpl.rc_context(STYLE):
        figure, axes = make_panels(1, len(SHOWN), 2.2)
        for ax, column in zip(axes, SHOWN, strict=True):
            for place, (recipe, runs) in enumerate(found.groupby("recipe", sort=False)):
                style = {"color": HEAD_COLOURS[place + 1], "marker": MARKERS[place + 1], "markersize": 3}
                ax.plot(runs["seconds"], runs[column.metric], label=recipe, **style)
            ax.set(xscale="log", xlabel="seconds of the fit", title=column.header)
        axes[0].set_yscale("log")
        axes[0].legend()
        figure.savefig(path, dpi=PNG_DPI)


if __name__ == "__main__":
    main(sys.argv[1:])
