"""A way to multiply matrices is taken where it was timed to be faster and is accurate: as on processors of any kind."""

import json
import logging
from collections.abc import Iterator
from dataclasses import asdict, replace
from pathlib import Path
from unittest import mock

import pytest
import torch

from jointsdf.training import matrix_products as module
from jointsdf.training.matrix_products import Products, Sizes, Trial, choose, chosen, compared, noted, use_matmul

SIZES = Sizes(300, 32, 2, torch.device("cpu"))
AUTO = Products("auto", "auto", "auto")
LOW = Products("default", "bfloat16", "bfloat16")
FAST, SLOW = (1.6, 1.4, 1.5, 1.9, 1.31), (0.01,)
AVX2 = {"architecture": "x86_64", "avx2": True, "avx512_f": False, "avx512_bf16": False, "amx_bf16": False}
AVX512 = AVX2 | {"avx512_f": True}
AVX512_BF16 = AVX512 | {"avx512_bf16": True}
AMX = AVX512_BF16 | {"amx_bf16": True, "amx_tile": True}
ARM = {"architecture": "aarch64", "sve": True}


@pytest.fixture(autouse=True)
def as_it_was() -> Iterator[None]:
    before = torch.backends.mkldnn.matmul.fp32_precision
    yield
    torch.backends.mkldnn.matmul.fp32_precision = before


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(module, "user_cache_path", lambda name: tmp_path / name)
    return tmp_path / "jointsdf" / "products"


def as_on(capabilities: dict, **trials: Trial) -> tuple[Products, dict[str, Products]]:
    """What is chosen with these timings, and what each was compared with."""
    asked: dict[str, Products] = {}

    def trial(key: str, products: Products) -> Trial:
        asked[key] = products
        return trials[key]

    return choose(capabilities, trial)[0], asked


@pytest.mark.parametrize("capabilities", [AVX2, AVX512], ids=["avx2", "avx512"])
def test_what_the_processor_emulates_is_not_even_timed(capabilities: dict) -> None:
    found, asked = as_on(capabilities, matmul=Trial(2e-7, (1.02,)))
    assert found == Products("default", "float32", "float32")
    assert asked.keys() == {"matmul"}


def test_bfloat16_is_taken_where_it_is_faster_each_time() -> None:
    timings = {"backward": Trial(2e-3, FAST), "orthogonalisation": Trial(3e-3, FAST)}
    assert as_on(AVX512_BF16, matmul=Trial(2e-7, (1.1,)), **timings)[0] == LOW


@pytest.mark.parametrize(
    "slow",
    [
        Trial(2e-3, SLOW),
        Trial(2e-3, (2.0, 2.0, 1.29)),
        Trial(2e-3, FAST[:4]),
        Trial(2e-3, (1.6, 1.4, 1.5, 1.9, 1.299)),
        Trial(0.3, FAST),
        Trial(float("nan"), FAST),
    ],
    ids=["emulated", "lost one", "four repeats", "lost the last", "inaccurate", "not a number"],
)
def test_one_lost_repeat_or_a_large_error_leaves_float32(slow: Trial) -> None:
    found, _ = as_on(AVX512_BF16, matmul=slow, backward=slow, orthogonalisation=slow)
    assert found == Products("default", "float32", "float32")


def test_onednn_that_rounds_to_bfloat16_is_refused_and_the_same_speed_with_float32_taken() -> None:
    """On AMX the switch to oneDNN really takes bfloat16; on AMD with AVX-512 it is float32, up to twice as fast."""
    low = {"backward": Trial(2e-3, SLOW), "orthogonalisation": Trial(3e-3, FAST)}
    assert as_on(AMX, matmul=Trial(2e-3, FAST), **low)[0] == Products("default", "float32", "bfloat16")
    found, asked = as_on(AMX, matmul=Trial(3e-7, FAST), **low)
    assert found == Products("onednn", "float32", "bfloat16")
    assert asked["backward"].matmul == "onednn", "bfloat16 is compared with the float32 products that are used"


def test_of_other_processors_only_the_timings_are_known() -> None:
    timings = {"matmul": Trial(2e-7, SLOW), "backward": Trial(2e-3, FAST), "orthogonalisation": Trial(3e-3, SLOW)}
    assert as_on(ARM, **timings)[0] == Products("default", "bfloat16", "float32")


def times(seconds: list[float]):
    """A clock that makes the calls take these seconds in turn."""
    moments = [0.0]
    for taken in seconds:
        moments += [moments[-1], moments[-1] + taken]
    return iter(moments[1:]).__next__


def test_repeats_are_side_by_side_the_best_of_three_counts_and_a_lost_one_is_the_last() -> None:
    order: list[str] = []
    sides = (lambda: order.append("usual")), (lambda: order.append("other"))
    first, second, lost = [3.0, 2.0, 9.0, 4.0, 1.0, 1.0], [3.0, 3.0, 3.0, 1.5, 7.0, 2.0], [1.2, 2.0, 2.0, 1.0, 1.0, 1.0]
    assert compared(*sides, clock=times(first + second + lost + first)) == pytest.approx((2.0, 2.0, 1.2))
    assert order == ["usual", "other"] + 3 * (3 * ["usual"] + 3 * ["other"])
    assert compared(*sides, clock=times(5 * first)) == pytest.approx((2.0,) * 5)


def test_the_timings_of_this_machine_are_of_products_that_are_what_they_say() -> None:
    trial = module._timed(SIZES)
    assert trial("matmul", Products()).error < 1e-5
    for key in ("backward", "orthogonalisation"):
        found = trial(key, Products())
        assert 5e-4 < found.error < 2e-2, "rounded to bfloat16"
        assert found.ratios
        assert min(found.ratios) > 0


def test_a_trunk_without_hidden_matrices_has_nothing_to_turn() -> None:
    trial = module._timed(replace(SIZES, matrices=0))("orthogonalisation", Products())
    assert not trial.passed(2e-2)


def test_a_choice_is_kept_for_its_machine_and_not_measured_again(cache: Path) -> None:
    with mock.patch.object(module, "choose", return_value=(LOW, {"backward": Trial(1e-3, FAST)})):
        assert chosen(AUTO, SIZES) == (LOW, "measured now")
    (path,) = cache.iterdir()
    kept = json.loads(path.read_text())
    assert kept["products"] == asdict(LOW)
    assert kept["trials"]["backward"]["ratios"] == list(FAST)
    with mock.patch.object(module, "choose", side_effect=AssertionError("measured again")):
        assert chosen(AUTO, SIZES) == (LOW, f"as measured before: {path}")
        assert chosen(replace(AUTO, backward="float32"), SIZES)[0] == replace(LOW, backward="float32")
    with mock.patch.object(module, "choose", return_value=(Products(), {})):
        assert chosen(AUTO, replace(SIZES, width=64))[0] == Products(), "other sizes are another question"
        assert chosen(AUTO, SIZES)[0] == LOW


@pytest.mark.parametrize("changed", ["processor", "threads", "restricted"])
def test_another_machine_is_measured_anew(cache: Path, monkeypatch: pytest.MonkeyPatch, changed: str) -> None:
    with mock.patch.object(module, "choose", return_value=(LOW, {})):
        chosen(AUTO, SIZES)
    if changed == "processor":
        monkeypatch.setattr(module, "cpu_model", lambda: "another")
    elif changed == "threads":
        monkeypatch.setattr(module, "workers", lambda: 77)
    else:
        monkeypatch.setenv("ONEDNN_MAX_CPU_ISA", "SSE41")
    with mock.patch.object(module, "choose", return_value=(Products(), {})):
        assert chosen(AUTO, SIZES)[0] == Products()
    assert len(list(cache.iterdir())) == 2


@pytest.mark.parametrize("damage", ["", "{}", '{"products": {"matmul": "magic"}}', '{"products": {"speed": 3}}', "[1]"])
def test_a_damaged_file_is_measured_again(cache: Path, damage: str) -> None:
    with mock.patch.object(module, "choose", return_value=(LOW, {})):
        chosen(AUTO, SIZES)
        (path,) = cache.iterdir()
        path.write_text(damage)
        assert chosen(AUTO, SIZES) == (LOW, "measured now")
    assert json.loads(path.read_text())["products"] == asdict(LOW)


def test_without_a_cache_folder_it_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setattr(module, "user_cache_path", lambda name: tmp_path / "file" / name)
    with mock.patch.object(module, "choose", return_value=(LOW, {})), caplog.at_level(logging.WARNING):
        assert chosen(AUTO, SIZES)[0] == LOW
    assert "the next fit measures its matrix products again" in caplog.text


def test_a_checkpoints_choice_wins_on_its_own_machine(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert not cache.exists()
    note = noted(Products("onednn", "float32", "bfloat16"), SIZES)
    torch.save(note, cache.parent.parent / "note")
    assert torch.load(cache.parent.parent / "note", weights_only=True) == note, "plain values"
    with mock.patch.object(module, "choose", return_value=(LOW, {})):
        chosen(AUTO, SIZES)
        assert chosen(AUTO, SIZES, note) == (Products("onednn", "float32", "bfloat16"), "of the checkpoint")
        assert chosen(replace(AUTO, matmul="default"), SIZES, note)[0].matmul == "default", "but not over a word"
        for odd in ({}, {"machine": note["machine"]}, note | {"products": {"matmul": "magic"}}, note | {"products": 3}):
            assert chosen(AUTO, SIZES, odd)[1].startswith("as measured before"), odd
        monkeypatch.setattr(module, "cpu_model", lambda: "another")
        assert chosen(AUTO, SIZES, note) == (LOW, "measured now")


@pytest.mark.parametrize("name", ["default", "onednn"])
def test_products_stay_float32_whatever_is_used(name: str) -> None:
    use_matmul(name)
    a, b = torch.randn(700, 256), torch.randn(256, 256)
    exact = a.double() @ b.double()
    assert ((a @ b - exact).norm() / exact.norm()).item() < 1e-6


def test_a_library_that_rounds_to_bfloat16_is_left_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_error", lambda *_: 2e-3)
    assert use_matmul("onednn") == "default"
    assert torch.backends.mkldnn.matmul.fp32_precision != "bf16"


def test_within_the_block_alone_products_go_another_way() -> None:
    use_matmul("default")
    with module.matmul("onednn"):
        assert torch.backends.mkldnn.matmul.fp32_precision == "bf16"
    assert torch.backends.mkldnn.matmul.fp32_precision != "bf16"
