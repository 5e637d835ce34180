"""Choice of matrix products: from the checkpoint, the cache file or trials, for one machine and one set of sizes."""

import json
import logging
from dataclasses import asdict, replace
from pathlib import Path
from unittest import mock

import pytest
import torch

from jointsdf.training import product_choice
from jointsdf.training.matrix_products import Products, Sizes
from jointsdf.training.product_choice import choice_record, choose_products
from jointsdf.training.product_trials import Trial

SIZES = Sizes(300, 32, 2, torch.device("cpu"))

AUTO = Products("auto", "auto", "auto")
LOW = Products("default", "bfloat16", "bfloat16")

FAST = (1.6, 1.4, 1.5, 1.9, 1.31)


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(product_choice, "user_cache_path", lambda name: tmp_path / name)
    return tmp_path / "jointsdf" / "products"


def test_a_choice_is_kept_for_its_machine_and_not_measured_again(cache: Path) -> None:
    with mock.patch.object(product_choice, "choose_by_trials", return_value=(LOW, {"backward": Trial(1e-3, FAST)})):
        assert choose_products(AUTO, SIZES) == (LOW, "measured now")
    (path,) = cache.iterdir()
    kept = json.loads(path.read_text())
    assert kept["products"] == asdict(LOW)
    assert kept["trials"]["backward"]["ratios"] == list(FAST)
    with mock.patch.object(product_choice, "choose_by_trials", side_effect=AssertionError("measured again")):
        assert choose_products(AUTO, SIZES) == (LOW, f"as measured before: {path}")
        assert choose_products(replace(AUTO, backward="float32"), SIZES)[0] == replace(LOW, backward="float32")
    with mock.patch.object(product_choice, "choose_by_trials", return_value=(Products(), {})):
        assert choose_products(AUTO, replace(SIZES, width=64))[0] == Products(), "other sizes are another question"
        assert choose_products(AUTO, SIZES)[0] == LOW


@pytest.mark.parametrize("changed", ["processor", "threads", "restricted"])
def test_another_machine_is_measured_anew(cache: Path, monkeypatch: pytest.MonkeyPatch, changed: str) -> None:
    with mock.patch.object(product_choice, "choose_by_trials", return_value=(LOW, {})):
        choose_products(AUTO, SIZES)
    if changed == "processor":
        monkeypatch.setattr(product_choice, "cpu_model", lambda: "another")
    elif changed == "threads":
        monkeypatch.setattr(product_choice, "workers", lambda: 77)
    else:
        monkeypatch.setenv("ONEDNN_MAX_CPU_ISA", "SSE41")
    with mock.patch.object(product_choice, "choose_by_trials", return_value=(Products(), {})):
        assert choose_products(AUTO, SIZES)[0] == Products()
    assert len(list(cache.iterdir())) == 2


@pytest.mark.parametrize("damage", ["", "{}", '{"products": {"matmul": "magic"}}', '{"products": {"speed": 3}}', "[1]"])
def test_a_damaged_file_is_measured_again(cache: Path, damage: str) -> None:
    with mock.patch.object(product_choice, "choose_by_trials", return_value=(LOW, {})):
        choose_products(AUTO, SIZES)
        (path,) = cache.iterdir()
        path.write_text(damage)
        assert choose_products(AUTO, SIZES) == (LOW, "measured now")
    assert json.loads(path.read_text())["products"] == asdict(LOW)


def test_without_a_cache_folder_it_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setattr(product_choice, "user_cache_path", lambda name: tmp_path / "file" / name)
    with (
        mock.patch.object(product_choice, "choose_by_trials", return_value=(LOW, {})),
        caplog.at_level(logging.WARNING),
    ):
        assert choose_products(AUTO, SIZES)[0] == LOW
    assert "the next fit measures its matrix products again" in caplog.text


def test_a_checkpoints_choice_wins_on_its_own_machine(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert not cache.exists()
    note = choice_record(Products("onednn", "float32", "bfloat16"), SIZES)
    torch.save(note, cache.parent.parent / "note")
    assert torch.load(cache.parent.parent / "note", weights_only=True) == note, "plain values"
    with mock.patch.object(product_choice, "choose_by_trials", return_value=(LOW, {})):
        choose_products(AUTO, SIZES)
        assert choose_products(AUTO, SIZES, note) == (Products("onednn", "float32", "bfloat16"), "of the checkpoint")
        assert choose_products(replace(AUTO, matmul="default"), SIZES, note)[0].matmul == "default", (
            "but not over a word"
        )
        for odd in ({}, {"machine": note["machine"]}, note | {"products": {"matmul": "magic"}}, note | {"products": 3}):
            assert choose_products(AUTO, SIZES, odd)[1].startswith("as measured before"), odd
        monkeypatch.setattr(product_choice, "cpu_model", lambda: "another")
        assert choose_products(AUTO, SIZES, note) == (LOW, "measured now")


def test_processes_that_measure_at_the_same_time_take_one_choice(cache: Path) -> None:
    def measure_meanwhile(*_) -> tuple[Products, dict[str, Trial]]:
        with mock.patch.object(product_choice, "choose_by_trials", return_value=(LOW, {})):
            choose_products(AUTO, SIZES)
        return Products(), {}

    with mock.patch.object(product_choice, "choose_by_trials", side_effect=measure_meanwhile):
        products, source = choose_products(AUTO, SIZES)
    assert products == LOW
    assert source.startswith("as measured meanwhile")
    assert json.loads(next(cache.iterdir()).read_text())["products"] == asdict(LOW)
