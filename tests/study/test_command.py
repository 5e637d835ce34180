"""The command line of the studies."""

import logging
from pathlib import Path

import pytest
from study_rows import line, make_row, read_table, write

from jointsdf.study.__main__ import main


def test_the_command_writes_and_names_the_tables(
    outputs: Path, caplog: pytest.LogCaptureFixture, capsys: pytest.CaptureFixture[str]
) -> None:
    (outputs / "broken").mkdir()
    (outputs / "broken" / "result.json").write_text("{")
    with caplog.at_level(logging.INFO):
        assert main(["tables", str(outputs), "--results", str(outputs / "none")]) == 0
    assert str(outputs / "tables" / "fast" / "main_reconstruction.tex") in caplog.text
    assert "broken" in caplog.text
    assert "Traceback" not in capsys.readouterr().err


def test_tables_of_some_heads_are_over_the_shapes_that_these_share(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    write(tmp_path, *(make_row("siren", f"abc_000{k}", cd_l1=1.0) for k in range(3)), make_row("relu", "abc_0001"))
    command = ["tables", str(tmp_path), "--results", str(tmp_path / "none")]
    assert main([*command, "--heads", "siren"]) == 0
    assert line(read_table(tmp_path, "main_reconstruction"), "siren")["n"] == 3
    assert main(command) == 0
    assert line(read_table(tmp_path, "main_reconstruction"), "siren")["n"] == 1
    assert main([*command, "--heads", "siren,none"]) == 2
    assert caplog.records[-1].getMessage() == "heads: no row of 'none'; there are rows of relu, siren"


@pytest.mark.parametrize("folder", ["", "missing"])
def test_no_rows_is_one_line_and_exit_code_2(tmp_path: Path, folder: str, caplog: pytest.LogCaptureFixture) -> None:
    assert main(["tables", str(tmp_path / folder), "--results", str(tmp_path / "none")]) == 2
    (record,) = caplog.records
    assert "no result rows below it; make one with `python train.py`" in record.getMessage()
    assert "\n" not in record.getMessage()
    assert list(tmp_path.iterdir()) == []
