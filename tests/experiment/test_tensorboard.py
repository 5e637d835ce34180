"""TensorBoard entries of a run: losses, rates, gradient norms, previews and the result, in one log."""

import math

import pytest
from command_line import finished
from PIL import Image
from run_folders import row_of
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

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
    pictures = [board.Images(f"result/{name}") for name in ("truth_and_prediction", "slice_truth_fit_error")]
    assert [[event.step for event in events] for events in pictures] == [[4], [4]]
    meshes, cut = ((event.height, event.width) for (event,) in pictures)
    with Image.open(finished() / "preview.png") as preview:
        assert preview.size == (meshes[1], meshes[0] + cut[0])
        assert cut[1] == meshes[1]
    assert any(tag.startswith("result/mesh") for tag in tags["tensors"])
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
