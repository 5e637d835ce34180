"""Export of fields: the page's numpy function, half precision, metadata, errors, whole files."""

import json
import os
import re
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from exported import FAR_AWAY, FORMS, assert_answers, everywhere, make_field
from study_rows import make_row
from torch import nn

import jointsdf
from jointsdf.errors import InputError
from jointsdf.export.__main__ import main
from jointsdf.export.about import describe, load_source
from jointsdf.export.layers import head_layers
from jointsdf.export.rounding import round_to_half, rounding_error
from jointsdf.model.field import JointField
from jointsdf.runs.row import write_row

BuildField = Callable[..., JointField]
PAGE = Path(__file__).parents[2] / "docs" / "export.md"


def page_function() -> Callable[..., Any]:
    """The numpy function of the documentation, as it stands there."""
    (code,) = [
        code
        for code in re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
        if "def " in code
    ]
    assert len(code.partition("def evaluate")[2].splitlines()) <= 60
    names: dict[str, Any] = {}
    exec(code, names)
    return names["evaluate"]


@pytest.mark.parametrize(("head", "far", "half"), FORMS)
def test_the_numpy_function_of_the_page_answers_as_the_field(
    small_field: BuildField, tmp_path: Path, head: str, far: str, half: bool
) -> None:
    field, points = make_field(small_field, head, far), everywhere()
    path = jointsdf.export_field(field, "npz", half=half, out=tmp_path / "field.npz")
    sdf, gradient, logits = page_function()(path, points)
    answers = {"sdf": sdf, "gradient": gradient, "logits": logits}
    assert_answers(answers, round_to_half(field) if half else field, points)


def test_half_precision_is_half_the_bytes_and_says_its_error(
    small_field: BuildField, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    field = make_field(small_field)
    caplog.set_level("INFO")
    sizes = {}
    for half in (False, True):
        path = jointsdf.export_field(field, "npz", half=half, out=tmp_path / f"{half}.npz")
        with np.load(path) as file:
            sizes[half] = sum(file[name].nbytes for name in file if name.startswith("trunk_weight"))
            assert file["trunk_weight_1"].dtype == (np.float16 if half else np.float32)
            assert file["trunk_weight_0"].dtype == np.float32
    assert sizes[True] < 0.6 * sizes[False]
    (said,) = [line for line in caplog.messages if "float16" in line]
    error = rounding_error(field, round_to_half(field))
    assert str(error) == said
    points = np.random.default_rng(1).uniform(-1.1, 1.1, (5000, 3))
    wanted = np.abs(round_to_half(field).network_sdf(points) - field.network_sdf(points)).max()
    assert error.box * 2 >= 0.8 * wanted
    assert 0 < error.near_p99 <= error.near < 1e-2
    assert rounding_error(field, field)[:3] == (0, 0, 0)


def test_a_half_field_file_is_loaded_again(small_field: BuildField, tmp_path: Path) -> None:
    field = make_field(small_field)
    field.about = {"shape": "a\u2028<b>", "unit": "in", "unit_known": True, "recipe": torch.zeros(3), "head": 5}
    path = jointsdf.export_field(field, "field", half=True, out=tmp_path / "small.ckpt")
    again = jointsdf.load_field(path)
    inside = FAR_AWAY.inverse(np.random.default_rng(0).uniform(-1, 1, (500, 3)))
    np.testing.assert_array_equal(again.query(inside).sdf, round_to_half(field).query(inside).sdf)
    about = describe(again)
    assert (about["shape"], about["unit"], about["unit_known"]) == ("a\u2028<b>", "in", True)
    assert about["recipe"] is about["head"] is None
    assert about["part_ids"] == [3, 7, 12, 40]
    assert about["part_names"] == ["part_3", "part_7", "part_12", "part_40"]
    assert about["centre"] == FAR_AWAY.centre.tolist()
    jointsdf.export_field(path, "npz", out=tmp_path / "again.npz")
    with np.load(tmp_path / "again.npz") as file:
        copied = json.loads(str(file["about"]))
    assert {name: copied[name] for name in about} == about


def test_the_command_exports_a_run(small_field: BuildField, tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    run, out = tmp_path / "run", tmp_path / "new" / "carried.npz"
    run.mkdir()
    make_field(small_field).save(run / "field.ckpt")
    write_row(run, replace(make_row("siren"), provenance={"unit": "mm", "unit_known": False}))
    caplog.set_level("INFO")
    assert main([str(run), "--to", "npz", "--half", "--out", str(out)]) == 0
    assert "float16 weights move the distance by at most" in caplog.text
    with np.load(out) as file:
        about = json.loads(str(file["about"]))
    found = [about[name] for name in ("shape", "head", "recipe", "unit", "unit_known")]
    assert found == ["abc_0001", "siren", "fast", "mm", False]
    assert [path.name for path in out.parent.iterdir()] == ["carried.npz"]
    assert main([str(tmp_path), "--to", "npz"]) == 2
    assert "no such field checkpoint" in caplog.messages[-1]
    (run / "result.json").write_text("{")
    assert main([str(run), "--to", "npz"]) == 2
    assert "result.json" in caplog.messages[-1]
    assert "\n" not in caplog.messages[-1]


@pytest.mark.parametrize(
    ("to", "out", "message"),
    [
        ("tflite", "x.npz", "--to=tflite: accepted are onnx, npz, field"),
        ("npz", None, "name the file to write"),
        ("npz", ".", "a folder; name the file"),
    ],
)
def test_wrong_requests_are_one_line(small_field: BuildField, to: str, out: str | None, message: str) -> None:
    with pytest.raises(InputError, match=message):
        jointsdf.export_field(make_field(small_field), to, out=out)


def test_the_field_that_is_read_is_not_written_over(small_field: BuildField, tmp_path: Path) -> None:
    make_field(small_field).save(tmp_path / "field.ckpt")
    before = (tmp_path / "field.ckpt").read_bytes()
    for source in (tmp_path, tmp_path / "field.ckpt"):
        with pytest.raises(InputError, match="the field itself"):
            jointsdf.export_field(source, "field")
    assert jointsdf.export_field(tmp_path, "field", half=True) == tmp_path / "field_half.ckpt"
    assert (tmp_path / "field.ckpt").read_bytes() == before


def test_a_file_is_written_whole_or_not_at_all(
    small_field: BuildField, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    field, out = make_field(small_field), tmp_path / "field.npz"
    out.write_bytes(b"before")

    def full(*_: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    for to in ("npz", "field"):
        with pytest.raises(OSError, match="No space"):
            jointsdf.export_field(field, to, out=out)
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [b"before"]


def test_onnx_that_is_missing_is_named(
    small_field: BuildField, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "onnx", None)
    with pytest.raises(InputError, match=r"pip install 'jointsdf\[onnx\]'"):
        jointsdf.export_field(make_field(small_field), "onnx", out=tmp_path / "field.onnx")
    assert not list(tmp_path.iterdir())


def test_a_head_without_an_exported_form_is_named() -> None:
    with pytest.raises(InputError, match="its GELU has no exported form"):
        head_layers(nn.Sequential(nn.Linear(3, 2), nn.GELU()))


def test_a_field_without_a_row_has_no_unit(small_field: BuildField, tmp_path: Path) -> None:
    make_field(small_field).save(tmp_path / "field.ckpt")
    assert describe(load_source(tmp_path))["unit"] is None
