"""No config of a received folder runs code, shows a secret or exhausts its reader: one line, an untouched canary."""

import logging
import shutil
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import yaml
from command_line import Answer, assert_one_line_error, call
from hostile_configs import (
    ALIVE,
    INTERPOLATIONS,
    MISPLACED,
    PLACES,
    RUN,
    SECRET,
    hostile_folder,
    payloads,
    placed,
)
from hostile_documents import DOCUMENTS

import jointsdf
from jointsdf.errors import InputError
from jointsdf.experiment.measurement import measure_again
from jointsdf.runs import folder as run_folder
from jointsdf.runs.row import read_row, write_row
from jointsdf.study.__main__ import main as study
from jointsdf.study.figures import __main__ as figures_module
from jointsdf.study.figures.run_meshes import load_pair
from jointsdf.training.module import JointSDFModule
from jointsdf.viewing.slice import main as draw_slice

pytestmark = pytest.mark.filterwarnings("default")
NAMES = list(payloads(Path(), Path()))
CASES = [
    *(("target", name) for name in NAMES),
    *(("place", name) for name in PLACES),
    *(("misplaced", name) for name in MISPLACED),
    *(("interpolation", name) for name in INTERPOLATIONS),
    *(("document", name) for name in DOCUMENTS),
]
HARMFUL = (  # without the table, in spite of Hydra's list of refused names
    *("torch.load", "torch.hub.download_url_to_file", "pandas.read_pickle", "numpy.load", "shutil.copyfile"),
    *("jointsdf.runs.files.write_atomically", "jointsdf.runs.folder._clear", "jointsdf.results.write_atomically"),
)
SOME = [  # of each kind, for commands that take a second
    ("target", "torch.load"),
    ("place", "evaluation.protocols.unit.metrics.chamfer"),
    ("interpolation", "a variable of the environment"),
    ("document", "an alias bomb"),
]


class Received:
    """A hostile run folder, and whether it did anything."""

    def __init__(self, place: Path, case: tuple[str, str]) -> None:
        self.outputs = place
        self.folder, self.canary = hostile_folder(place)
        self.config = self.folder / "config.yaml"
        self.config.write_text(self._text(*case))
        self.before = self.files()

    def _text(self, kind: str, name: str) -> str:
        if kind == "document":
            document = DOCUMENTS[name]
            return document() if callable(document) else document
        if kind == "target":  # at places that evaluate.py builds, in turn
            places = ("extraction.method", "evaluation.protocols.unit.metrics.x", "evaluation.protocols.unit.frame")
            key, value = places[NAMES.index(name) % 3], payloads(self.folder, self.canary)[name]
        elif kind == "place":
            key, value = name, payloads(self.folder, self.canary)["torch.load"]
        else:
            key, value = (MISPLACED | INTERPOLATIONS)[name]
        return yaml.safe_dump(placed(key, value))

    def files(self) -> dict[str, bytes]:
        return {str(path): path.read_bytes() for path in self.outputs.rglob("*") if path.is_file()}

    def assert_untouched(self) -> None:
        assert self.canary.read_text() == ALIVE
        assert self.files() == self.before


@pytest.fixture
def received(tmp_path: Path, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Received:
    monkeypatch.setenv("SECRET", SECRET)
    return Received(tmp_path / "out", request.param)


def of(cases: Sequence[tuple[str, str]]) -> Callable[..., Any]:
    return pytest.mark.parametrize("received", cases, indirect=True, ids=" ".join)


def assert_refusal(message: str, path: Path) -> None:
    """One printable line about the config, of bounded length, without the reader's secret."""
    assert message.startswith(f"{path}: ")
    assert message.isprintable()
    assert len(message) < 600
    assert SECRET not in message
    assert "=" in message or "write its value" in message, "the fix"


@of(CASES)
def test_whoever_reads_the_config_refuses_it(received: Received, caplog: pytest.LogCaptureFixture) -> None:
    for read in (measure_again, load_pair):
        with pytest.raises(InputError) as refused:
            read(received.folder)
        assert_refusal(str(refused.value), received.config)
    assert draw_slice([str(received.folder), str(received.outputs / "slice.png")]) == 2
    (line,) = caplog.messages
    assert_refusal(line.removeprefix("error: "), received.config)
    received.assert_untouched()


@of(SOME)
def test_evaluate_refuses_it(received: Received) -> None:
    answer = call("evaluate.py", f"run={received.folder}")
    assert_one_line_error(answer, str(received.config))
    assert len(answer.lines) == 1
    assert SECRET not in answer.text
    received.assert_untouched()


@pytest.fixture
def no_fit(monkeypatch: pytest.MonkeyPatch) -> None:
    def forbidden(*_: object) -> None:
        raise AssertionError("trained")

    monkeypatch.setattr(JointSDFModule, "training_step", forbidden)


def again(received: Received, *more: str) -> Answer:
    return call("train.py", *RUN, f"paths.outputs={received.outputs}", *more)


@pytest.mark.usefixtures("no_fit")
@of(SOME)
def test_train_refuses_it_whether_it_resumes_or_finds_the_run_done(received: Received) -> None:
    assert_one_line_error(again(received), str(received.config))
    received.assert_untouched()
    (received.folder / "result.json").rename(received.folder / "last.ckpt")
    received.before = received.files()
    assert_one_line_error(again(received), str(received.config))
    received.assert_untouched()


@pytest.mark.usefixtures("no_fit")
@of(SOME[:1])
def test_the_library_refuses_it(received: Received) -> None:
    place = received.outputs / "fitted"
    shutil.copytree(received.folder, place)
    with pytest.raises(InputError) as refused:
        jointsdf.fit("part_01", recipe="smoke", overrides=RUN[1:], out=place, quiet=True)
    assert_refusal(str(refused.value), place / "config.yaml")
    assert received.canary.read_text() == ALIVE


@of(SOME[:1])
def test_tables_status_and_figures_run_nothing(
    received: Received, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    caplog.set_level(logging.INFO)
    monkeypatch.setattr(figures_module, "PLOTS", {})  # of rows alone
    options = [str(received.outputs), "--results", str(received.outputs / "none")]
    row = read_row(received.folder / "result.json")
    write_row(received.folder.parents[1] / "part_02/seed0", replace(row, shape="part_02"))
    assert study(["tables", *options]) == 0
    assert study(["status", "smoke", *options]) == 0
    assert study(["results", "smoke", *options[:2], str(received.outputs / "results")]) == 0
    assert figures_module.main(options) == 0
    assert any(f"the first: {received.config}: " in line for line in caplog.messages)
    assert SECRET not in caplog.text
    assert received.canary.read_text() == ALIVE


@of([("target", name) for name in NAMES if name in HARMFUL])
def test_without_the_table_the_canary_dies(received: Received, monkeypatch: pytest.MonkeyPatch) -> None:
    """The oracle of the other tests: these payloads do what they are there for."""
    monkeypatch.setattr(run_folder, "require_trusted", lambda *_: None)
    with pytest.raises(Exception):  # noqa: B017, PT011 (what comes of it then does not matter)
        measure_again(received.folder)
    assert not received.canary.exists() or received.canary.read_bytes() != ALIVE.encode()
