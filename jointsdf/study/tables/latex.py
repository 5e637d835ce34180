"""LaTeX: cells of numbers, escaping, and a booktabs table by pandas' Styler."""

import math
import re
from collections.abc import Sequence
from typing import Literal

import pandas as pd

from jointsdf.study.statistics import Summary

Goal = Literal["low", "high", "none"]
MISSING = "--"
TALL = 45  # lines; a longer table is scaled to fit a page
SMALLEST_P = 0.001  # smaller ones are shown as below it
FIT_HEIGHT = r"\resizebox*{!}{0.8\textheight}"
FIT_WIDTH = r"\resizebox{\ifdim\width>\linewidth\linewidth\else\width\fi}{!}"
ESCAPES = {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    "±": r"$\pm$",
} | {character: f"\\{character}" for character in "&%$#_{}"}
LATIN = re.compile(r"[\0-\x7fÀ-ÖØ-öø-ÿ]")  # ASCII, and the letters of Latin-1, which encoding T1 has


def escape(text: str) -> str:
    r"""Escape plain text for LaTeX; `±` becomes the symbol, what encoding T1 has no Latin letter for a question mark.

    >>> escape("deep_skip & 50%")
    'deep\\_skip \\& 50\\%'
    """
    return "".join(ESCAPES.get(character, character if LATIN.match(character) else "?") for character in text)


def cell(summary: Summary, *, digits: int, out_of: int, bold: bool) -> str:
    """Format `mean ± std`, with n where it is below `out_of`, the table's number of shapes; `--` for n = 0.

    One shape has no spread.
    """
    if summary.n == 0:
        return MISSING
    mean = f"{summary.mean:.{digits}f}"
    count = f" ($n={summary.n}$)" if summary.n < out_of else ""
    spread = "" if math.isnan(summary.std) else rf" $\pm$ {summary.std:.{digits}f}"
    return (rf"\textbf{{{mean}}}" if bold else mean) + spread + count


def mark_best(summaries: Sequence[Summary], *, digits: int, out_of: int, goal: Goal) -> list[bool]:
    """Mark the best means as printed; several on a tie.

    A mean over fewer than `out_of` shapes does not compete: the hard shapes may be missing. One mean alone is not best.
    """
    shown = [float(f"{item.mean:.{digits}f}") if item.n == out_of else math.nan for item in summaries]
    competing = [value for value in shown if not math.isnan(value)]
    if goal == "none" or len(competing) < 2:
        return [False] * len(shown)
    target = min(competing) if goal == "low" else max(competing)
    return [value == target for value in shown]


def format_number(value: float, digits: int, *, signed: bool = False) -> str:
    """Format a number in math mode, for its minus sign."""
    return f"${value:{'+' if signed else ''}.{digits}f}$"


def format_p_value(p: float) -> str:
    """Format a p value; `--` for NaN.

    >>> [format_p_value(p) for p in (0.25, 1e-5)]
    ['0.250', '$<$0.001']
    """
    if math.isnan(p):
        return MISSING
    return f"{p:.3f}" if p >= SMALLEST_P else "$<$0.001"


def tabular(cells: pd.DataFrame, *, caption: str, label: str, blocks: Sequence[int] = ()) -> str:
    """Floating booktabs table of LaTeX cells, scaled down where it is wider than the text (needs graphicx).

    Args:
        cells: Strings; the column names are the header, LaTeX as well.
        caption: Plain text; escaped here.
        label: Name to refer to, behind `tab:`. Underscores become hyphens.
        blocks: Lines with vertical space after them.
    """
    text = cells.style.hide(axis="index").to_latex(
        hrules=True,
        caption=escape(caption),
        label="tab:" + label.replace("_", "-"),
        column_format="l" + "c" * (cells.shape[1] - 1),
        position="htbp",
        position_float="centering",
    )
    above, rule, body = text.partition("\\midrule\n")
    lines = body.splitlines(keepends=True)
    for place in sorted(set(blocks) - {len(cells) - 1}, reverse=True):
        lines.insert(place + 1, "\\addlinespace\n")
    text = above + rule + "".join(lines)
    boxes = (FIT_WIDTH, FIT_HEIGHT) if len(cells) > TALL else (FIT_WIDTH,)
    start = "".join(box + "{%\n" for box in boxes) + "\\setlength{\\tabcolsep}{4pt}\\begin{tabular}"
    return text.replace(r"\begin{tabular}", start).replace(r"\end{tabular}", r"\end{tabular}" + "}" * len(boxes))
