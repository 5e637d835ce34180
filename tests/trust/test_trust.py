"""What the user names or trusts on the command line is built; what a folder alone names is not."""

import logging
from pathlib import Path

import own_metric
import pytest
import yaml
from command_line import PLACE, Answer, assert_one_line_error, call
from hostile_configs import RUN, hostile_folder, placed

from jointsdf.runs.row import read_row
from jointsdf.study.figures.run_meshes import load_pair
from jointsdf.training.module import JointSDFModule
from jointsdf.viewing.slice import main as draw_slice

pytestmark = pytest.mark.filterwarnings("default")
KEY = "evaluation.protocols.unit.metrics.answer"
OWN = f"+{KEY}={{_target_:own_metric.Answer,value:7}}"


@pytest.fixture(autouse=True)
def _nothing_built() -> None:
    own_metric.built.clear()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A finished run whose config names a metric of the user's module."""
    folder, _ = hostile_folder(tmp_path)
    config = placed(KEY, {"_target_": "own_metric.Answer", "value": 7})
    (folder / "config.yaml").write_text(yaml.safe_dump(config))
    return folder


def test_evaluate_builds_what_is_trusted_and_nothing_else(folder: Path) -> None:
    refusal = f"{KEY}._target_ is own_metric.Answer, "
    for trust in ([], ["trust=own"], ["trust=[os,torch]"]):
        assert_one_line_error(call("evaluate.py", f"run={folder}", *trust), refusal, "trust=own_metric allows it")
        assert own_metric.built == []
    answer = call("evaluate.py", f"run={folder}", "trust=own_metric")
    assert answer.code == 0, answer.text
    assert own_metric.built == [7]
    assert ["unit", "answer", "7.000000"] in [line.split()[:3] for line in answer.lines]


def test_trust_is_of_one_command(folder: Path) -> None:
    assert call("evaluate.py", f"run={folder}", "trust=[own_metric]").code == 0
    assert call("evaluate.py", f"run={folder}").code == 2
    (folder / "config.yaml").write_text("trust: [own_metric]\n" + (folder / "config.yaml").read_text())
    assert call("evaluate.py", f"run={folder}").code == 2, "the folder's own word for it is worth nothing"


def test_what_is_no_module_is_one_line(folder: Path) -> None:
    for trust in ("trust=a/b", "trust=3", "trust=[a,null]", "trust={a:b.c-d}"):
        assert_one_line_error(call("evaluate.py", f"run={folder}", trust), "trust=", "give a module")


def test_a_slice_and_figures_take_it_as_an_option(folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO)
    picture = folder.parent / "slice.png"
    assert draw_slice([str(folder), str(picture)]) == 2
    assert "trust=own_metric" in caplog.messages[-1]
    assert draw_slice([str(folder), str(picture), "--trust", "os", "--trust", "own_metric"]) == 0
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert len(load_pair(folder, ["own_metric"]).predicted.faces) == 12
    assert own_metric.built == [], "neither builds it"


@pytest.fixture
def _nothing_is_trained(monkeypatch: pytest.MonkeyPatch) -> None:
    def forbidden(*_: object) -> None:
        raise AssertionError("trained again")

    monkeypatch.setattr(JointSDFModule, "training_step", forbidden)


@pytest.mark.usefixtures("_nothing_is_trained")
def test_what_the_command_names_is_trusted_when_it_comes_again(folder: Path) -> None:
    """`train.py` builds what its own command says, and nothing that the folder says."""

    def again(*more: str) -> Answer:
        return call("train.py", *RUN, f"paths.outputs={folder.parents[4]}", *more)

    for trusted in (OWN, "trust=own_metric"):
        answer = again(trusted)
        assert answer.code == 0, answer.text
        assert "holds this run's result already" in answer.text
    assert_one_line_error(again(), "own_metric.Answer", "trust=own_metric")
    assert set(own_metric.built) == {7}


def test_a_class_of_the_command_makes_a_run_whose_config_says_so(tmp_path: Path) -> None:
    assert call("train.py", *RUN, f"paths.outputs={tmp_path}", OWN, "trust=json", "extraction.resolution=8").code == 0
    config = yaml.safe_load((tmp_path / PLACE / "config.yaml").read_text())
    assert config["evaluation"]["protocols"]["unit"]["metrics"]["answer"]["_target_"] == "own_metric.Answer"
    assert "trust" not in config
    assert read_row(tmp_path / PLACE / "result.json").scores["unit"]["answer"] == 7
