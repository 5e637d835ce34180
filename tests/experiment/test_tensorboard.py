"""TensorBoard entries of a run: losses, rates, gradient norms, previews and the result, in one log."""

import math

import pandas as pd
import pytest
from command_line import PLACE, assert_one_line_error, finished, train
from PIL import Image
from run_folders import assert_same_weights, finished_weights, row_of, weights
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from tensorboard.plugins.hparams import plugin_data_pb2

from jointsdf.runs.folder import read_config
from jointsdf.training import loggers

pytestmark = pytest.mark.filterwarnings("default")
TERMS = ("dirichlet", "sign_agnostic", "eikonal", "signed_distance", "cross_entropy", "total")


def test_tensorboard_shows_everything():
    board = EventAccumulator(str(finished() / "tb"), {"images": 0, "tensors": 0, "scalars": 0})
    board.Reload()
    tags = board.Tags()
    for term in TERMS:
        assert [event.step for event in board.Scalars(f"loss/{term}")] == [0, 1, 2, 3], term
        assert all(math.isfinite(event.value) for event in board.Scalars(f"loss/{term}"))
    rates = [tag for tag in tags["scalars"] if tag.startswith("lr-")]
    assert sorted(tag.rpartition("/")[2] for tag in rates) == ["head", "hidden", "trunk"]
    assert all(len(board.Scalars(tag)) == 4 for tag in rates)
    for part in ("trunk", "head"):
        assert len(board.Scalars(f"gradient_norm/{part}")) == 4
    for column in ("cd_l1", "nc", "miou"):
        assert [event.step for event in board.Scalars(f"preview_12/{column}")] == [2]
    assert [event.step for event in board.Images("preview_12/truth_and_prediction")] == [2]
    names = ("truth_prediction_error", "numbers", "slice_truth_fit_error")
    pictures = [board.Images(f"result/{name}") for name in names]
    assert [[event.step for event in events] for events in pictures] == [[4], [4], [4]]
    sizes = [(event.height, event.width) for (event,) in pictures]
    with Image.open(finished() / "preview.png") as preview:
        assert preview.size == (sizes[0][1], sum(height for height, _ in sizes))
    assert {width for _, width in sizes} == {sizes[0][1]}
    title = "part_01, siren, seed 0, smoke base: ground truth and fit"
    assert {f"{title}/{k}_{what}" for k in (0, 1) for what in ("VERTEX", "FACE", "COLOR")} <= set(tags["tensors"])
    scores = row_of(finished())["scores"]["unit"]
    measured = {f"result/{name}": value for name, value in scores.items() if value is not None}
    assert {"result/cd_l1", "result/miou"} <= measured.keys()
    assert measured.keys() == {tag for tag in tags["scalars"] if tag.startswith("result/")}
    for tag, value in measured.items():
        assert [event.value for event in board.Scalars(tag)] == [pytest.approx(value)], tag


def test_hparams_are_in_the_same_log():
    board = EventAccumulator(str(finished() / "tb"))
    board.Reload()
    assert board.PluginTagToContent("hparams").keys() == {
        "_hparams_/experiment",
        "_hparams_/session_start_info",
        "_hparams_/session_end_info",
    }
    assert not [path for path in (finished() / "tb").iterdir() if path.is_dir()]
    content = board.summary_metadata["_hparams_/session_start_info"].plugin_data.content
    said = plugin_data_pb2.HParamsPluginData.FromString(content).session_start_info.hparams
    found = {name: value.string_value or value.number_value for name, value in said.items()}
    wanted = {"study": "smoke", "variant": "base", "recipe": "smoke", "head": "siren", "shape": "part_01", "steps": 4}
    assert found.items() >= wanted.items()
    assert found["weight/eikonal"] == pytest.approx(read_config(finished())["loss"]["weights"]["eikonal"])


def test_csv_has_the_curves_and_the_same_weights(tmp_path):
    answer = train(tmp_path, "trainer.preview_every=2", "logger=csv")
    assert answer.code == 0, answer.text
    folder = tmp_path / PLACE
    assert not (folder / "tb").exists()
    curves = pd.read_csv(folder / "csv" / "version_0" / "metrics.csv")
    assert {f"loss/{term}" for term in TERMS} | {"preview_12/cd_l1", "gradient_norm/head"} <= set(curves.columns)
    assert curves["loss/total"].dropna().index.size == 4
    assert row_of(folder)["provenance"]["config_hash"] == row_of(finished())["provenance"]["config_hash"]
    assert_same_weights(weights(tmp_path), finished_weights())


def test_a_logger_that_is_unknown_or_missing_is_one_line(tmp_path, monkeypatch):
    assert_one_line_error(train(tmp_path, "logger.name=mlflow"), "logger=mlflow", "tensorboard, csv, wandb")
    monkeypatch.setattr(loggers, "find_spec", lambda _: None)
    assert_one_line_error(train(tmp_path, "logger=wandb"), "pip install 'jointsdf[wandb]'")
    assert not list(tmp_path.rglob("*.ckpt"))
