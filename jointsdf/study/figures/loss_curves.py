"""Loss curves from the TensorBoard event files of the runs, read without torch or TensorFlow."""

import logging
from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from jointsdf.study.captions import caption
from jointsdf.study.comparisons import Comparison, compare
from jointsdf.study.figures.style import STYLE, Drawing, add_legend, head_style, make_panels
from jointsdf.study.groups import Group

BOARD, PREFIX, TOTAL = "tb", "loss/", "total"
NARROW = 100  # largest over smallest value up to which ticks are at 1, 2 and 5 of each decade
log = logging.getLogger(__name__)

Curves = dict[str, pd.Series]  # name -> value by step


def run_folder(outputs: Path, run: pd.Series) -> Path:
    """Folder of a run's files."""
    return outputs.joinpath(*(str(run[name]) for name in ("study", "variant", "head", "shape")), f"seed{run['seed']}")


def loss_curves(group: Group, outputs: Path) -> tuple[Drawing | None, list[str]]:
    """Each loss term over the steps, a line per head: median over the runs, with the quartiles.

    Args:
        group: Runs that may be compared.
        outputs: Folder of the studies.

    Returns:
        The figure, None where no run has curves; and a message for each run without.
    """
    comparison = compare(group, baseline=True)
    found: dict[str, list[Curves]] = {head: [] for head in comparison.heads}
    missing = []
    for _, run in comparison.runs.iterrows():
        folder = run_folder(outputs, run)
        curves = read_curves(folder / BOARD)
        if curves:
            found[str(run["head"])].append(curves)
        else:
            missing.append(f"{folder / BOARD} has no loss curves")
    if not any(found.values()):
        return None, missing
    return _draw(comparison, found), missing


def read_curves(folder: Path, prefix: str = PREFIX) -> Curves:
    """Read the scalars of a folder of event files whose tag has the prefix, by default the loss terms.

    Returns:
        Name -> value by step; empty where there is none, or the files are damaged.
    """
    from google.protobuf.message import DecodeError  # type: ignore[import-untyped]
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    if not any(folder.glob("events.*")):
        return {}
    logging.getLogger("tensorboard").setLevel(logging.ERROR)  # a killed run may leave a partial last record
    events = EventAccumulator(str(folder), size_guidance={"scalars": 0, "images": 1, "tensors": 1})
    try:
        events.Reload()
    except (OSError, ValueError, DecodeError):  # a folder in place of a file, or no event in a record
        return {}
    curves = {}
    for tag in events.Tags()["scalars"]:
        if tag.startswith(prefix):
            by_step = {event.step: event.value for event in events.Scalars(tag)}  # of a resumed run: the last value
            curves[tag.removeprefix(prefix)] = pd.Series(by_step, dtype=float).sort_index()
    return curves


def _scale_by_decades(ax: Axes) -> None:
    """Make the y axis logarithmic where all is positive, with plain numbers at its ticks."""
    values = np.concatenate([np.asarray(line.get_ydata(), dtype=float) for line in ax.lines])
    if not (values > 0).all():
        return
    ax.set_yscale("log")
    narrow = values.max() < NARROW * values.min()
    ax.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5) if narrow else (1,)))
    ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.yaxis.set_minor_formatter(NullFormatter())


def _draw(comparison: Comparison, found: Mapping[str, Sequence[Curves]]) -> Drawing:
    terms = list(dict.fromkeys(term for runs in found.values() for curves in runs for term in curves))
    terms.sort(key=lambda term: term != TOTAL)
    heads = [head for head in comparison.heads if found[head]]
    with mpl.rc_context(STYLE):
        rows = -(-len(terms) // 3)
        figure, axes = make_panels(rows, 3, 0.35 + 1.7 * rows)
        for ax, term in zip(axes, terms, strict=False):
            for head in heads:
                lines = pd.DataFrame({k: curves[term] for k, curves in enumerate(found[head]) if term in curves})
                if lines.empty:
                    continue
                style = head_style(head, comparison.heads)
                low, middle, high = (lines.quantile(q, axis="columns") for q in (0.25, 0.5, 0.75))
                ax.fill_between(lines.index, low, high, color=style["color"], alpha=0.15, linewidth=0)
                ax.plot(lines.index, middle, color=style["color"], linestyle=style["linestyle"], label=head)
            ax.set_title("total, weighted" if term == TOTAL else term.replace("_", " "))
            ax.set_xlabel("step")
            _scale_by_decades(ax)
        for ax in axes[len(terms) :]:
            ax.set_axis_off()
        add_legend(figure, heads, lines=True)
    counts = ", ".join(f"{head} {len(found[head])}" for head in heads)
    what = (
        f"Loss terms (not weighted; total: weighted sum) over the steps: median and quartiles over the runs ({counts})"
    )
    return Drawing(figure, caption(what, comparison, unequal=False))
