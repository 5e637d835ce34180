"""The page of a study: from rows alone, with 3D pages where run folders are, and in a browser."""

import json
import math
import re
from pathlib import Path
from typing import Any

import pytest
from chromium import browser, find_chromium
from command_line import finished
from run_folders import OUTPUTS_LEVEL
from study_rows import NAN, make_row

from jointsdf.errors import InputError
from jointsdf.runs.row import ResultRow, read_row
from jointsdf.study.page.__main__ import main
from jointsdf.study.page.study_page import write_study_page

pytestmark = pytest.mark.filterwarnings("default")
ROOT = Path(__file__).parents[3]
NASTY = "<script>alert(1)</script>"


def rows() -> list[ResultRow]:
    return [
        make_row("siren", "a", 0, cd_l1=0.4, cd_l1_floor=0.2, nc=0.9),
        make_row("siren", "a", 1, cd_l1=0.3, cd_l1_floor=0.2, nc=NAN),
        make_row("relu", "a", 0, cd_l1=NAN, status="empty_mesh"),
        make_row("siren", NASTY.replace("/", "|"), 0, cd_l1=0.2, cd_l1_floor=0.2, nc=1.0),
        make_row("siren", "elsewhere", study="other", cd_l1=9.0, cd_l1_floor=1.0),
    ]


def data_of(page: Path) -> Any:
    text = page.read_text(encoding="utf-8")
    assert "<script>alert" not in text
    (found,) = re.findall(r'<script type="application/json" id="page-data">(.*?)</script>', text, re.DOTALL)
    return json.loads(found)


def test_rows_alone_make_a_page(tmp_path: Path) -> None:
    data = data_of(write_study_page("fast", rows(), tmp_path / "none", tmp_path / "page"))
    assert [path.name for path in (tmp_path / "page").iterdir()] == ["index.html"]
    assert data["columns"] == ["relu", "siren"]
    assert data["shapes"] == [NASTY.replace("/", "|"), "a"]
    assert (data["pages"], data["truths"]) == ({}, None)
    column = [measure["column"] for measure in data["measures"]].index("cd_l1_over_floor")
    nc = [measure["column"] for measure in data["measures"]].index("nc")
    values = {(run["column"], run["shape"], run["seed"]): run["values"] for run in data["runs"]}
    assert values["siren", "a", 0][column] == 2.0
    assert values["siren", "a", 1][nc] is None, "a missing number is none, not 0"
    assert values["relu", "a", 0][column] is None
    assert len(data["runs"]) == 4, "of this study alone"


def test_variants_are_columns_of_their_own(tmp_path: Path) -> None:
    some = [make_row("siren", "a", variant=name, cd_l1=1.0, cd_l1_floor=1.0) for name in ("base", "tap=2")]
    data = data_of(write_study_page("fast", some, tmp_path, tmp_path / "page"))
    assert data["columns"] == ["siren, base", "siren, tap=2"]


def test_the_committed_study_is_shown_from_its_rows(tmp_path: Path) -> None:
    where = ["--outputs", str(tmp_path / "none"), "--results", str(ROOT / "results"), "--page", str(tmp_path / "page")]
    assert main(["--study", "main", *where]) == 0
    page = tmp_path / "page" / "index.html"
    data = data_of(page)
    assert (len(data["runs"]), len(data["shapes"]), len(data["columns"])) == (200, 50, 4)
    assert page.stat().st_size < 300_000
    assert not any(math.isinf(value) for run in data["runs"] for value in run["values"] if value is not None)


def test_run_folders_open_in_3d_and_are_not_made_twice(tmp_path: Path) -> None:
    folder, outputs = finished(), finished().parents[OUTPUTS_LEVEL]
    row = read_row(folder / "result.json")
    page = write_study_page("smoke", [row], outputs, tmp_path)
    data = data_of(page)
    for name in (data["pages"]["part_01"], data["truths"]["part_01"], data["runs"][0]["picture"], "library.js"):
        assert (tmp_path / name).is_file(), name
    shape = tmp_path / data["pages"]["part_01"]
    assert shape.stat().st_size < 1.2e6, (
        "50 shapes by 5 heads stay below 60 MB: the truth, and a fit like this one each"
    )
    assert 'src="../library.js"' in shape.read_text(encoding="utf-8")
    before = shape.stat().st_mtime_ns
    write_study_page("smoke", [row], outputs, tmp_path)
    assert shape.stat().st_mtime_ns == before


def test_what_is_not_there_is_said_in_a_line(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    with pytest.raises(InputError, match="--study nothing: no row of it; there are rows of fast, other"):
        write_study_page("nothing", rows(), tmp_path, tmp_path / "page")
    assert main([]) == 2
    assert "--study main" in caplog.text


@pytest.mark.browser
@pytest.mark.skipif(find_chromium() is None, reason="no Chromium: apt install chromium")
def test_the_study_in_a_browser(tmp_path: Path) -> None:
    more = [make_row("relu", f"s{k}", cd_l1=1.0 + k, cd_l1_floor=1.0, nc=0.5) for k in range(12)]
    row = read_row(finished() / "result.json")
    some = [*rows(), *more]
    write_study_page("fast", some, tmp_path, tmp_path / "rows")
    write_study_page("smoke", [row], finished().parents[OUTPUTS_LEVEL], tmp_path / "runs")
    program = find_chromium()
    assert program is not None
    with browser(program) as tab:
        tab.open(tmp_path / "rows" / "index.html", width=1200, height=900)
        shapes = "[...document.querySelectorAll('#grid tbody th')].map((cell) => cell.textContent)"
        first = "document.querySelector('#rows tbody td').textContent"
        assert tab.run(shapes)[0] == "s11", "worst first"
        assert NASTY.replace("/", "|") in tab.run(shapes)
        assert tab.run(first) == "s11"
        tab.run("document.querySelectorAll('#rows thead button')[0].click()")
        assert tab.run(first) == NASTY.replace("/", "|")
        tab.run("document.querySelectorAll('#rows thead button')[4].click()")
        tab.run("document.querySelectorAll('#rows thead button')[4].click()")
        assert tab.run("document.querySelector('#rows tbody td:nth-child(5)').textContent") == "1", "best first"
        assert tab.run("document.querySelector('#rows tbody tr:last-child td:nth-child(5)').textContent") == ""
        assert tab.run("document.querySelectorAll('#plot .point').length") == 14, "of runs with both numbers"
        tab.run("document.querySelector('#plot .point').focus()")
        assert "seed 0" in tab.run("document.getElementById('plot-tip').textContent")
        assert tab.errors == []
        tab.open(tmp_path / "runs" / "index.html", width=1200, height=900)
        assert tab.run("document.querySelector('#grid img').decode().then(() => true)")
        link = tab.run("document.querySelector('#grid a').getAttribute('href')")
        tab.open(tmp_path / "runs" / link, width=1200, height=900)
        assert tab.run("document.body.dataset.state") == "ready"
        assert tab.errors == []
        assert {request.partition(":")[0] for request in tab.requests} == {"file"}
