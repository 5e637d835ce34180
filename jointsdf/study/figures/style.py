"""Style of all figures, and their files: vector PDF, PNG, and a LaTeX float."""

from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO
from itertools import pairwise
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy import ndarray

from jointsdf.runs.files import write_atomically
from jointsdf.study.comparisons import HEAD_ORDER
from jointsdf.study.tables.latex import escape
from jointsdf.viewing.palette import HEAD_COLOURS

WIDTH = 7.0  # inches, of a page's text
INK, PALE = "#222222", "#8a8a8a"
MARKERS = ("X", "o", "s", "^", "D", "v", "P", "*")
DASHES = ("-", "-", "--", "-.", ":", (0, (5, 1)), (0, (3, 1, 1, 1)), (0, (1, 1)))
PNG_DPI = 200
ENDINGS = (".pdf", ".png", ".tex")
NEAR = 0.03  # of the range: points closer than this are shifted apart
STYLE: Any = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 8,
    "axes.titlesize": 8,
    "axes.labelsize": 8,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "legend.fontsize": 8,
    "axes.edgecolor": INK,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.5,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "pdf.fonttype": 42,
    "lines.linewidth": 1.2,
}


@dataclass(frozen=True)
class Drawing:
    """A figure and its caption in plain text."""

    figure: Figure
    caption: str


def head_style(head: str, heads: Sequence[str]) -> dict[str, Any]:
    """Colour, marker and dashes of a head: the paper's heads have the same in every figure."""
    others = sorted(set(heads) - set(HEAD_ORDER))
    place = HEAD_ORDER.index(head) if head in HEAD_ORDER else len(HEAD_ORDER) + others.index(head)
    place = place % len(HEAD_COLOURS)  # in grey, see the markers
    return {"color": HEAD_COLOURS[place], "marker": MARKERS[place], "linestyle": DASHES[place]}


def make_panels(rows: int, columns: int, height: float) -> tuple[Figure, list[Axes]]:
    """Make a page-wide figure of panels; axes row by row.

    Args:
        rows: Of panels.
        columns: Of panels.
        height: Inches in all.
    """
    figure = Figure(figsize=(WIDTH, height), layout="constrained")
    axes: Any = figure.subplots(rows, columns, squeeze=False)
    return figure, list(axes.ravel())


def add_legend(figure: Figure, heads: Sequence[str], *, lines: bool = False, others: Sequence[Line2D] = ()) -> None:
    """Add a legend of the heads, and of other lines, above all panels."""
    keys = []
    for head in heads:
        style = head_style(head, heads)
        dashes = style.pop("linestyle")
        mark = {"marker": "", "linestyle": dashes} if lines else {"linestyle": ""}
        keys.append(Line2D([], [], label=head, markersize=5, **(style | mark)))
    keys += others
    figure.legend(handles=keys, loc="outside upper center", ncols=min(len(keys), 7), frameon=False, handlelength=2.4)


def dodge(values: Float[ndarray, " n"], width: float) -> Float[ndarray, " n"]:
    """Shift points of nearly the same value sideways (a deterministic beeswarm); the same for the same values.

    Args:
        values: Along the axis that the points are spread over.
        width: Largest shift.
    """
    shifts = np.zeros(len(values))
    near = NEAR * np.ptp(values) if len(values) else 0.0
    order = np.argsort(values, kind="stable")
    run = 0
    for before, here in pairwise(order):
        run = run + 1 if values[here] - values[before] <= near else 0
        shifts[here] = (run + 1) // 2 * (-1) ** run
    largest = np.abs(shifts).max(initial=1.0)
    scaled: ndarray = shifts * min(width / largest, width / 3)
    return scaled


def write_drawing(drawing: Drawing, stem: Path, label: str) -> list[Path]:
    """Write `<stem>.pdf`, `.png` and `.tex`, whose label is `fig:<label>`, with hyphens for underscores.

    Raises:
        OSError: The folder cannot be written.
    """
    written = [stem.with_name(stem.name + ending) for ending in ENDINGS]
    for path in written[:2]:
        content = BytesIO()
        kind = path.suffix[1:]
        undated = {"CreationDate": None} if kind == "pdf" else {}
        with mpl.rc_context(STYLE):
            drawing.figure.savefig(content, format=kind, dpi=PNG_DPI, metadata=undated)
        write_atomically(path, content.getvalue())
    lines = [
        r"\begin{figure}[htbp]",
        r"\centering",
        rf"\includegraphics[width=\linewidth]{{{written[0].name}}}",
        rf"\caption{{{escape(drawing.caption)}}}",
        rf"\label{{fig:{label.replace('_', '-')}}}",
        r"\end{figure}",
    ]
    write_atomically(written[2], "\n".join(lines) + "\n")
    return written
