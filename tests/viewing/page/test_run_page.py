"""The page of runs: its structure, its escaping, its size, and that its data are those of the run."""

import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cloud_files import as_text, on_box, written
from command_line import assert_one_line_error, finished, train
from run_folders import own_copy

from jointsdf.errors import InputError
from jointsdf.geometry.distance import ClosestPoint
from jointsdf.model.field import JointField
from jointsdf.runs.row import read_row, write_row
from jointsdf.shapes.stored import stored_truth
from jointsdf.study.page.__main__ import main
from jointsdf.viewing.page.packing import unpack
from jointsdf.viewing.page.run_page import write_run_page
from jointsdf.viewing.page.scene import Fit
from jointsdf.viewing.page.stored_runs import fit_names, stored_warnings, view_runs
from jointsdf.viewing.part_mesh import stored_mesh

pytestmark = pytest.mark.filterwarnings("default")
NASTY = "<script>alert(1)</script>&amp;\"'\u2028<!--"


class Elements(HTMLParser):
    """Elements of a page, and the text outside scripts and styles."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str | None]]] = []
        self.text = ""
        self._inside = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, dict(attrs)))
        self._inside = tag

    def handle_endtag(self, tag: str) -> None:
        self._inside = "" if tag == self._inside else self._inside

    def handle_data(self, data: str) -> None:
        self.text += data if self._inside not in ("script", "style") else ""


def data_of(text: str) -> Any:
    """The JSON of a page, read as a browser reads it."""
    (found,) = re.findall(r'<script type="application/json" id="page-data">(.*?)</script>', text, re.DOTALL)
    return json.loads(found)


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> str:
    return view_runs([finished()], tmp_path_factory.mktemp("page") / "report.html").read_text(encoding="utf-8")


def test_the_page_is_one_file_that_needs_no_other(page: str) -> None:
    elements = Elements(page).found
    assert not {"link", "iframe", "object", "img"} & {tag for tag, _ in elements}
    assert all("src" not in attributes for _, attributes in elements)
    (policy,) = [attributes["content"] for tag, attributes in elements if tag == "meta" and "http-equiv" in attributes]
    assert policy is not None
    assert policy.startswith("default-src 'none'")
    assert "http" not in policy
    assert len(page.encode()) < 8e6


def test_every_control_has_a_label_and_the_heading_order_is_right(page: str) -> None:
    without_script = re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL)
    labels = re.findall(r"<label[^>]*>.*?</label>", without_script, re.DOTALL)
    for control in re.findall(r"<(?:input|select)[^>]*>", without_script):
        assert "aria-label" in control or any(control in label for label in labels), control
    levels = [int(tag[1]) for tag, _ in Elements(page).found if re.fullmatch("h[1-6]", tag)]
    assert levels[0] == 1
    assert levels.count(1) == 1


def test_its_meshes_are_those_of_the_run(page: str) -> None:
    data = data_of(page)
    _, shape = stored_truth(finished())
    assert shape.truth is not None
    fit = stored_mesh(finished(), is_empty=False)
    assert [surface["role"] for surface in data["surfaces"]] == ["truth", "fit"]
    for surface, mesh in zip(data["surfaces"], (shape.truth.mesh, fit), strict=True):
        arrays = unpack(surface["arrays"])
        steps = arrays["vertices"].reshape(-1, 3)
        vertices = np.array(surface["box"]["low"]) + steps * np.array(surface["box"]["step"])
        faces = arrays["faces"].reshape(-1, 3)
        rounding = max(surface["box"]["step"])
        assert ClosestPoint(mesh).query(vertices[faces].mean(axis=1))[0].max() <= surface["moved"] * 1.5 + rounding
        ids = np.unique(np.concatenate([shape.truth.mesh.labels, fit.labels]))
        assert set(ids[arrays["parts"]]) == set(np.unique(mesh.labels))
    arrays = unpack(data["surfaces"][1]["arrays"])
    assert np.abs(arrays["error"]).max() * data["surfaces"][1]["error_step"] <= data["largest"] * (1 + 1e-9)
    row = read_row(finished() / "result.json")
    assert f"{row.scores['unit']['cd_l1']:.4g}" in Elements(page).text


def test_names_of_users_stay_text(tmp_path: Path) -> None:
    folder = finished()
    _, shape = stored_truth(folder)
    row = read_row(folder / "result.json")
    row = replace(row, shape=NASTY, head=NASTY, provenance=row.provenance | {"label_provider": NASTY, NASTY: NASTY})
    fit = Fit(NASTY, stored_mesh(folder, is_empty=False), JointField.load(folder / "field.ckpt"))
    write_run_page(tmp_path / "a.html", replace(shape, name=NASTY), [(fit, row)], warnings=[NASTY])
    text = (tmp_path / "a.html").read_text(encoding="utf-8")
    assert "<script>alert" not in text
    assert "<!--" not in text
    elements = Elements(text)
    assert sum(tag == "script" for tag, _ in elements.found) == 3, "modules, data, start"
    assert elements.text.count("<script>alert(1)</script>") >= 5, "seen as it was typed"
    assert data_of(text)["surfaces"][1]["name"] == NASTY


def test_a_run_writes_its_page_and_what_it_warned_of(tmp_path: Path) -> None:
    answer = train(tmp_path, "viewing.page=true", "shape=part_01")
    assert answer.code == 0, answer.text
    (report,) = tmp_path.rglob("report.html")
    assert f"open {report} (browser, 3D)" in answer.text
    (warning,) = stored_warnings(report.parent)
    assert "thinnest wall" in warning
    assert warning in Elements(report.read_text(encoding="utf-8")).text
    before = read_row(finished() / "result.json")
    after = read_row(report.parent / "result.json")
    assert after.provenance["config_hash"] == before.provenance["config_hash"], "the page decides no number"


def test_heads_of_one_shape_share_a_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert main([str(finished()), str(own_copy(tmp_path))]) == 0
    data = data_of((tmp_path / "view.html").read_text(encoding="utf-8"))
    assert [surface["name"] for surface in data["surfaces"]] == ["ground truth", "siren (1)", "siren (2)"]
    assert len({surface.get("colour") for surface in data["surfaces"]}) == 3
    rows = [replace(read_row(finished() / "result.json"), **change) for change in ({}, {"seed": 3}, {"head": "relu"})]
    assert fit_names(rows) == ["siren seed 0", "siren seed 3", "relu seed 0"]


def test_points_without_a_mesh_are_shown_as_points(tmp_path: Path) -> None:
    scan = written(tmp_path, "scan.xyzc", as_text(on_box(1500)))
    answer = train(tmp_path / "out", f"shape={scan}", "data.distances=cloud", "viewing.page=true")
    assert answer.code == 0, answer.text
    (report,) = tmp_path.rglob("report.html")
    points, fit = data_of(report.read_text(encoding="utf-8"))["surfaces"]
    assert (points["kind"], points["faces"], "field" in points) == ("points", 1500, False)
    assert (unpack(fit["arrays"])["error"] >= 0).all(), "no side is known beside points"
    assert len(unpack(fit["arrays"])["missed"]) == 1500
    assert "held-out points" in Elements(report.read_text(encoding="utf-8")).text


def test_a_fit_without_a_surface_has_a_page(tmp_path: Path) -> None:
    folder = own_copy(tmp_path)
    row = replace(read_row(folder / "result.json"), status="empty_mesh")
    write_row(folder, row)
    text = view_runs([folder]).read_text(encoding="utf-8")
    assert "the field has no surface in the box" in Elements(text).text
    assert data_of(text)["surfaces"][1]["faces"] == 0


def test_what_is_no_run_is_refused_in_a_line(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no finished run"):
        view_runs([tmp_path])
    assert_one_line_error(train(tmp_path, "viewing.page=maybe"), "viewing.page=maybe")
