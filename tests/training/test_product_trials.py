"""Trials of matrix products: an alternative is chosen if it is accurate, and faster in every repeat."""

from dataclasses import replace

import pytest
import torch

from jointsdf.training.matrix_products import Products, Sizes
from jointsdf.training.product_trials import Trial, choose_by_trials, measure_speedups, trials_of_sizes

SIZES = Sizes(300, 32, 2, torch.device("cpu"))
LOW = Products("default", "bfloat16", "bfloat16")
FAST, SLOW = (1.6, 1.4, 1.5, 1.9, 1.31), (0.01,)
AVX2 = {"architecture": "x86_64", "avx2": True, "avx512_f": False, "avx512_bf16": False, "amx_bf16": False}
AVX512 = AVX2 | {"avx512_f": True}
AVX512_BF16 = AVX512 | {"avx512_bf16": True}
AMX = AVX512_BF16 | {"amx_bf16": True, "amx_tile": True}
ARM = {"architecture": "aarch64", "sve": True}


def as_on(capabilities: dict, **trials: Trial) -> tuple[Products, dict[str, Products]]:
    """What is chosen with these timings, and what each was compared with."""
    asked: dict[str, Products] = {}

    def trial(key: str, products: Products) -> Trial:
        asked[key] = products
        return trials[key]

    return choose_by_trials(capabilities, trial)[0], asked


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
    assert measure_speedups(*sides, clock=times(first + second + lost + first)) == pytest.approx((2.0, 2.0, 1.2))
    assert order == ["usual", "other"] + 3 * (3 * ["usual"] + 3 * ["other"])
    assert measure_speedups(*sides, clock=times(5 * first)) == pytest.approx((2.0,) * 5)


def test_the_timings_of_this_machine_are_of_products_that_are_what_they_say() -> None:
    trial = trials_of_sizes(SIZES)
    assert trial("matmul", Products()).error < 1e-5
    for key in ("backward", "orthogonalisation"):
        found = trial(key, Products())
        assert 5e-4 < found.error < 2e-2, "rounded to bfloat16"
        assert found.ratios
        assert min(found.ratios) > 0


def test_a_trunk_without_hidden_matrices_has_nothing_to_turn() -> None:
    trial = trials_of_sizes(replace(SIZES, matrices=0))("orthogonalisation", Products())
    assert not trial.passed(2e-2)
