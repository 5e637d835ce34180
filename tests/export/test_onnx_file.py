"""Fields as ONNX models, run by onnxruntime."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from exported import FAR_AWAY, FORMS, assert_answers, everywhere, make_field

import jointsdf
from jointsdf.export.rounding import round_to_half
from jointsdf.model.field import JointField

onnx = pytest.importorskip("onnx", reason="onnx is no part of the locked environment: pip install 'jointsdf[onnx]'")
onnxruntime = pytest.importorskip("onnxruntime", reason="onnxruntime is no part of the locked environment")

BuildField = Callable[..., JointField]


@pytest.mark.parametrize(("head", "far", "half"), FORMS)
def test_the_model_answers_as_the_field(
    small_field: BuildField, tmp_path: Path, head: str, far: str, half: bool
) -> None:
    field, points = make_field(small_field, head, far), everywhere()
    path = jointsdf.export_field(field, "onnx", half=half, out=tmp_path / "field.onnx")
    session = onnxruntime.InferenceSession(str(path))
    names = [output.name for output in session.get_outputs()]
    assert names == ["sdf", "gradient"] + ["logits", "part"] * (head != "none")
    answers = dict(zip(names, session.run(None, {"points": points}), strict=True))
    assert_answers(answers, round_to_half(field) if half else field, points)
    options = onnxruntime.RunOptions()
    options.only_execute_path_to_fetches = True
    (sdf,) = session.run(["sdf"], {"points": points[:1]}, options)
    np.testing.assert_allclose(sdf, answers["sdf"][:1], rtol=0, atol=1e-4)
    (none,) = session.run(["gradient"], {"points": points[:0]})
    assert none.shape == (0, 3)


def test_frame_unit_and_parts_are_in_the_models_metadata(small_field: BuildField, tmp_path: Path) -> None:
    field = make_field(small_field)
    field.about = {"shape": "bracket", "unit": "mm", "unit_known": False}
    sizes = {}
    for half in (False, True):
        path = jointsdf.export_field(field, "onnx", half=half, out=tmp_path / "field.onnx")
        sizes[half] = path.stat().st_size
        model = onnx.load(path)
        about = {entry.key: entry.value for entry in model.metadata_props}
        assert about["format"] == "jointsdf field 1"
        assert (about["shape"], about["unit"], about["unit_known"]) == ("bracket", "mm", "false")
        assert json.loads(about["part_ids"]) == [3, 7, 12, 40]
        assert json.loads(about["centre"]) == FAR_AWAY.centre.tolist()
        kinds = {constant.data_type for constant in model.graph.initializer}
        assert (onnx.TensorProto.FLOAT16 in kinds) == half
    assert sizes[True] < sizes[False]
