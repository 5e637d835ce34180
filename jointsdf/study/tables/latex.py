"""Numbers and names as LaTeX: cells, escaping, and a booktabs table by pandas' Styler."""

import math
from collections.abc import Sequence
from typing import Literal

import pandas as pd

from jointsdf.study.statistics import Summary

Goal = Literal["low", "high", "none"]
MISSING = "--"
TALL = 45  # lines; a longer table is made to fit a page
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


def escape(text: str) -> str:
    """Plain text that LaTeX prints as it is; `±` becomes the symbol, what is not ASCII a question mark."""
    return "".join(ESCAPES.get(character, character if character.isascii() else "?") for character in text)


def cell(summary: Summary, *, digits: int, out_of: int, bold: bool) -> str:
    """`mean ± std`, followed by its n where fewer shapes have the number than the table has; `--` where none has."""
    if summary.n == 0:
        return MISSING
    mean = f"{summary.mean:.{digits}f}"
    count = f" ($n={summary.n}$)" if summary.n < out_of else ""
    return (rf"\textbf{{{mean}}}" if bold else mean) + rf" $\pm$ {summary.std:.{digits}f}{count}"


def best(summaries: Sequence[Summary], *, digits: int, out_of: int, goal: Goal) -> list[bool]:
    """Which means are the best ones as printed; several on a tie.

    A mean over fewer than `out_of` shapes does not compete: it may have lost the hard ones. One mean alone is not best.
    """
    shown = [float(f"{item.mean:.{digits}f}") if item.n == out_of else math.nan for item in summaries]
    competing = [value for value in shown if not math.isnan(value)]
    if goal == "none" or len(competing) < 2:
        return [False] * len(shown)
    target = min(competing) if goal == "low" else max(competing)
    return [value == target for value in shown]


def number(value: float, digits: int, *, signed: bool = False) -> str:
    """A number in math mode, so that its minus is one."""
    return f"${value:{'+' if signed else ''}.{digits}f}$"


def p_value(p: float) -> str:
    """A p value; `--` where there is none."""
    if math.isnan(p):
        return MISSING
    return f"{p:.3f}" if p >= 0.001 else "$<$0.001"


def tabular(cells: pd.DataFrame, *, caption: str, label: str, blocks: Sequence[int] = ()) -> str:
    """A floating booktabs table of ready LaTeX cells, made narrower where it is wider than the text (needs graphicx).

    Args:
        cells: Strings; the column names are the header, LaTeX as well.
        caption: Plain text; escaped here.
        label: Name to refer to, behind `tab:`. Underscores become hyphens.
        blocks: Lines that a gap follows.
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
