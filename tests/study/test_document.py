"""The document of all tables and figures."""

import shutil
from pathlib import Path

import pytest
from study_rows import make_row, results_with_the_paper, write

from jointsdf.study.__main__ import main


@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="no TeX here")
def test_the_report_compiles_with_every_table(eight: Path) -> None:
    assert main(["report", str(eight), "--results", str(results_with_the_paper(eight))]) == 0
    assert (eight / "tables" / "report.pdf").read_bytes().startswith(b"%PDF")
    text = (eight / "tables" / "report.tex").read_text()
    names = [path.relative_to(eight / "tables").as_posix() for path in (eight / "tables").glob("*/*.tex")]
    assert len(names) > 5
    for name in names:
        assert rf"\input{{{name}}}" in text


def test_no_tex_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> None:
    write(tmp_path, make_row(cd_l1=1.0))
    monkeypatch.setenv("PATH", "")
    assert main(["report", str(tmp_path), "--results", str(tmp_path / "none")]) == 2
    assert "report.tex is written, its PDF is not: no TeX found" in caplog.records[-1].getMessage()
