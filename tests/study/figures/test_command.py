"""The command line of the figures."""

import logging
from pathlib import Path

import pytest
from drawings import rows
from study_rows import make_row

from jointsdf.runs.row import write_row
from jointsdf.study.figures.__main__ import main, write_figures


def test_the_command_writes_what_it_can_and_says_what_it_cannot(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    for row in rows():
        write_row(tmp_path / "main" / "base" / row.head / row.shape / "seed0", row)
    with caplog.at_level(logging.INFO):
        assert main([str(tmp_path), "--results", str(tmp_path / "none")]) == 0
    made = ("metric_comparison", "error_scatter", "time_quality", "part_count_plot")
    folder = tmp_path / "figures" / "main"
    assert {path.name for path in folder.iterdir()} == {f"{n}.{e}" for n in made for e in ("pdf", "png", "tex")}
    for name in made:
        assert (folder / f"{name}.pdf").read_bytes().startswith(b"%PDF")
        assert (folder / f"{name}.png").stat().st_size > 5000
        assert rf"\includegraphics[width=\linewidth]{{{name}.pdf}}" in (folder / f"{name}.tex").read_text()
    said = [record.getMessage() for record in caplog.records if record.levelno == logging.WARNING]
    assert [line.partition(":")[0] for line in said] == ["triptychs", "failures", "loss_curves"]
    assert "without 4 run folders, the first: " in said[0]
    assert all("\n" not in line for line in said)


def test_figures_of_groups_gone_since_are_deleted(tmp_path: Path) -> None:
    folder = tmp_path / "figures"
    folder.mkdir()
    for name in ("time_quality--old.pdf", "triptychs.png", "mine.png"):
        (folder / name).write_text("")
    assert write_figures([make_row("relu")], tmp_path) == []
    assert [path.name for path in folder.iterdir()] == ["mine.png"]


def test_no_rows_is_one_line_and_exit_code_2(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    assert main([str(tmp_path), "--results", str(tmp_path)]) == 2
    assert "no result rows below it" in caplog.records[-1].getMessage()
