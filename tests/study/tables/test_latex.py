"""Cells, escaping and the form of every table."""

import re
from pathlib import Path

from study_rows import NAN

from jointsdf.study.statistics import Summary
from jointsdf.study.tables.latex import cell, escape, mark_best


def test_escape_covers_every_special_character() -> None:
    assert escape("deep_skip & 50% #1 ±") == r"deep\_skip \& 50\% \#1 $\pm$"
    assert (
        escape("a\\b{c}<~^$|") == r"a\textbackslash{}b\{c\}\textless{}\textasciitilde{}\textasciicircum{}\$\textbar{}"
    )


def test_escape_keeps_the_letters_that_latex_sets() -> None:
    assert escape("Gehäuse-Øß \xd7÷ \u96f6\u0159") == "Gehäuse-Øß ?? ??"


def test_cell_says_when_shapes_are_missing() -> None:
    assert cell(Summary(3, 0.12345, 0.1), digits=3, out_of=3, bold=False) == r"0.123 $\pm$ 0.100"
    assert cell(Summary(2, 0.12345, 0.1), digits=2, out_of=3, bold=True) == r"\textbf{0.12} $\pm$ 0.10 ($n=2$)"
    assert cell(Summary(1, 0.12345, NAN), digits=2, out_of=1, bold=False) == "0.12"
    assert cell(Summary(0, NAN, NAN), digits=2, out_of=3, bold=False) == "--"


def test_best_is_by_direction_as_printed_among_complete_means() -> None:
    summaries = [Summary(2, 0.5001, 0.0), Summary(2, 0.4999, 0.0), Summary(2, 0.7, 0.0), Summary(1, 0.1, 0.0)]
    assert mark_best(summaries, digits=2, out_of=2, goal="low") == [True, True, False, False]
    assert mark_best(summaries, digits=2, out_of=2, goal="high") == [False, False, True, False]
    assert mark_best(summaries, digits=2, out_of=2, goal="none") == [False] * 4
    assert mark_best(summaries[:1], digits=2, out_of=2, goal="low") == [False]


def test_every_tex_is_balanced_booktabs(outputs: Path) -> None:
    files = [path for path in (outputs / "tables").glob("*/*.tex") if path.stem != "report"]
    assert {"paired_reconstruction", "correlation", "part_count", "cost"} < {path.stem for path in files}
    for path in files:
        text = path.read_text(encoding="utf-8")
        bare = re.sub(r"\\[{}]", "", text)
        assert bare.count("{") == bare.count("}")
        assert text.count("$") % 2 == 0
        assert [text.count(rule) for rule in (r"\toprule", r"\midrule", r"\bottomrule", r"\caption{")] == [1, 1, 1, 1]
        assert text.count(r"\begin{") == text.count(r"\end{") == 2
        columns = len(re.search(r"\\begin\{tabular\}\{(\w+)\}", text)[1])  # type: ignore[index]
        rows = [row for row in text.splitlines() if row.endswith(r"\\")]
        assert {row.count(" & ") + 1 for row in rows} == {columns}
        outside_math = re.sub(r"\$[^$]*\$", "", re.sub(r"\\_", "", text))
        assert "_" not in outside_math
        assert text.isascii()
