"""Damaged configs, checkpoints, boards and meshes of a run folder, and odd places: one line, never a traceback."""

import json
import logging
import os
import struct
from collections.abc import Sequence
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from command_line import ROOT, assert_one_line_error, call, train
from damaged_documents import WHOLE
from gltf_files import GltfFile
from hostile_configs import CONFIG, RUN, hostile_folder
from hydra import compose, initialize_config_dir
from tensorboard.summary.writer.record_writer import masked_crc32c

import jointsdf
from jointsdf.errors import InputError
from jointsdf.evaluation import reference_scores
from jointsdf.experiment import measurement
from jointsdf.experiment.config_checks import check_settings
from jointsdf.experiment.settings import resolve
from jointsdf.runs.fingerprint import NUMBERS
from jointsdf.study.figures.loss_curves import read_curves
from jointsdf.study.figures.run_meshes import load_pair

pytestmark = pytest.mark.filterwarnings("default")
KEYS = (  # that evaluate.py and the figures read
    *("shape", "labels", "head", "paths", "tessellation", "identity", "identity.shape"),
    *("evaluation", "evaluation.protocols", "evaluation.protocols.unit.metrics", "extraction", "extraction.resolution"),
)
TRIED = (None, [], 3)


def assert_refusal(message: str, *named: object) -> None:
    assert message.isprintable(), message
    assert len(message) < 1000
    for name in named:
        assert str(name) in message


def junk_at(folder: Path, keys: Sequence[str], junk: Any) -> None:
    """The stored config with junk at each of some dotted keys, or for `...` without them."""
    config = deepcopy(CONFIG)
    for key in keys:
        *outer, last = key.split(".")
        inner = config
        for name in outer:
            inner = inner[name]
        if junk is ...:
            del inner[last]
        else:
            inner[last] = junk
    (folder / "config.yaml").write_text(yaml.safe_dump(config))


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A finished run that is not measured."""
    monkeypatch.setattr(measurement, "extract", lambda _, measures, **__: (measures, None))
    monkeypatch.setattr(measurement, "measure", lambda *_: {})
    return hostile_folder(tmp_path)[0]


@pytest.mark.parametrize("key", KEYS)
def test_a_config_with_junk_at_a_key_is_one_line(folder: Path, key: str) -> None:
    for junk in (*TRIED, ...):
        junk_at(folder, [key], junk)
        for read in (measurement.measure_again, load_pair)[: 2 if junk is None else 1]:
            if key == "extraction.resolution" or (key.startswith(("evaluation", "extraction")) and read is load_pair):
                read(folder)  # which the row's grid replaces, and of which pictures need none
                continue
            with pytest.raises(InputError) as refused:
                read(folder)
            assert_refusal(str(refused.value))


def test_junk_at_keys_that_decide_nothing_afterwards_is_no_matter(folder: Path) -> None:
    asked = {*NUMBERS, *(key.partition(".")[0] for key in KEYS), "num_parts", "partfield_dir", "unit"}
    for junk in TRIED:
        junk_at(folder, [key for key in CONFIG if key not in asked], junk)
        measurement.measure_again(folder)


def test_a_head_that_is_null_is_one_line_for_every_command(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    folder, _ = hostile_folder(tmp_path)
    config = CONFIG | {"head": None}
    (folder / "config.yaml").write_text(yaml.safe_dump(config))
    assert_one_line_error(call("evaluate.py", f"run={folder}"), str(folder))
    config["identity"] = config["identity"] | {"head": None}
    (folder / "config.yaml").write_text(yaml.safe_dump(config))
    caplog.clear()
    assert_one_line_error(call("train.py", *RUN, f"paths.outputs={tmp_path}"), str(folder), "holds another config")


@pytest.mark.parametrize("grid", [..., None, True, "256", 25.6, {"a": 1}, 0, -4, 10**9])
def test_a_row_without_its_grid_is_one_line(tmp_path: Path, grid: Any) -> None:
    folder, _ = hostile_folder(tmp_path)
    content = json.loads((folder / "result.json").read_text())
    if grid is ...:
        del content["provenance"]["resolution"]
    else:
        content["provenance"]["resolution"] = grid
    (folder / "result.json").write_text(json.dumps(content))
    with pytest.raises(InputError) as refused:
        measurement.measure_again(folder)
    assert_refusal(str(refused.value), "resolution")


@pytest.mark.parametrize("name", [name for name in WHOLE if name != "an empty object"])
def test_a_damaged_cache_of_reference_scores_is_measured_again(tmp_path: Path, name: str) -> None:
    path = tmp_path / "scores.json"
    WHOLE[name](path, {"unit": {"cd_l1_floor": 0.5}})
    assert reference_scores._read(path) in (None, {"unit": {"cd_l1_floor": 0.5}})
    path = tmp_path / "whole.json"
    path.write_text('{"unit": {"cd_l1_floor": 0.5, "nc_floor": NaN}}')
    found = reference_scores._read(path)
    assert found is not None
    assert (found["unit"]["cd_l1_floor"], str(found["unit"]["nc_floor"])) == (0.5, "nan")


def record(payload: bytes) -> bytes:
    """A record of an events file, with the right checksums."""
    length = struct.pack("<Q", len(payload))
    sums = [struct.pack("<I", masked_crc32c(part)) for part in (length, payload)]
    return length + sums[0] + payload + sums[1]


BOARDS = {
    "empty": b"",
    "text": b"x" * 1000,
    "zeros": bytes(1000),
    "a record cut": record(b"x" * 100)[:60],
    "a record of no event": record(b"\xff" * 20),
    "a length beyond its end": b"\xff" * 7 + b"\x0f" + bytes(100),
    "a folder": None,
}


@pytest.mark.parametrize("content", BOARDS.values(), ids=BOARDS)
def test_a_damaged_board_has_no_curves(tmp_path: Path, content: bytes | None, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.CRITICAL, "tensorboard")
    path = tmp_path / "events.out.tfevents.1"
    if content is None:
        path.mkdir()
    else:
        path.write_bytes(content)
    assert read_curves(tmp_path) == {}


@pytest.mark.parametrize(
    ("children", "scenes"),
    [([[0]], [[0]]), ([[1], [0]], [[0]]), ([[1], [2], [1]], [[0]]), ([[1], [0]], None), ([[1, 1], []], [[0]])],
)
def test_a_gltf_scene_with_a_cycle_is_one_line(
    tmp_path: Path, children: list[list[int]], scenes: list[list[int]] | None
) -> None:
    file = GltfFile()
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=np.float32)
    mesh = file.mesh(file.primitive(corners, np.array([0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2], dtype=np.uint16)))
    for below in children:
        file.node(root=False, mesh=mesh, children=below)
    if scenes is None:
        del file.document["scenes"], file.document["scene"]
    else:
        file.document["scenes"] = [{"nodes": roots} for roots in scenes]
    path = tmp_path / "cycle.glb"
    path.write_bytes(file.glb())
    with pytest.raises(InputError) as refused:
        jointsdf.load_shape(path)
    assert_refusal(str(refused.value), path, "is in a cycle, or is the child of two nodes")


@pytest.mark.parametrize("key", ["study", "variant", "recipe"])
def test_a_name_that_is_no_folder_of_one_line_is_refused(key: str) -> None:
    with initialize_config_dir(str(ROOT / "conf"), version_base="1.3"):
        given = resolve(compose("config", [f"shape={CONFIG['shape']}"]))
    for name in ("", "a\nb", "a\x1b[2Jb", "a\u2028b", "a\x85b", "a\ud800b", "x" * 256, "..", "a/b", ".a", "a\\b"):
        with pytest.raises(InputError) as refused:
            check_settings(given | {key: name})
        assert_refusal(str(refused.value), f"{key}=", "give a name of one line")
    check_settings(given | {key: "Gehäuse, v2 (tap=1)"})


def test_a_study_of_two_lines_is_refused_on_the_command_line(tmp_path: Path) -> None:
    assert_one_line_error(train(tmp_path, "study='a\nb'"), "study=", "give another name")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("script", ["train.py", "evaluate.py"])
def test_a_deleted_working_directory_is_one_line(tmp_path: Path, script: str) -> None:
    before = Path.cwd()
    gone = tmp_path / "gone"
    gone.mkdir()
    os.chdir(gone)
    try:
        gone.rmdir()
        answer = call(script, "run=x" if script == "evaluate.py" else "recipe=smoke")
    finally:
        os.chdir(before)
    assert_one_line_error(answer, "the working directory is deleted")
