import math

import numpy as np
import pytest
from scipy import stats
from study_rows import NAN, make_row

from jointsdf.study.collect import collect
from jointsdf.study.statistics import (
    Summary,
    common_shapes,
    holm,
    outer_quarters,
    paired_tests,
    pearson,
    per_shape,
    summarise,
)


def test_summary_is_the_sample_mean_and_std_without_nan() -> None:
    assert summarise([1.0, NAN, 3.0, 5.0]) == Summary(3, 3.0, 2.0)
    one = summarise([4.0])
    assert (one.n, one.mean) == (1, 4.0)
    assert math.isnan(one.std), "one value has no spread"
    nothing = summarise([NAN])
    assert nothing.n == 0
    assert math.isnan(nothing.mean)


def test_seeds_are_averaged_within_a_shape_first() -> None:
    runs = collect([make_row(seed=0, nc=0.2), make_row(seed=1, nc=0.4), make_row(seed=2, nc=NAN)])
    assert per_shape(runs, "nc") == {"abc_0001": pytest.approx(0.3)}
    assert math.isnan(per_shape(runs, "unheard_of")["abc_0001"])


def test_common_shapes_names_who_lacks_the_others() -> None:
    runs = collect([make_row("relu", "a"), make_row("relu", "b"), make_row("siren", "b"), make_row("siren", "c")])
    assert common_shapes(runs) == (["b"], {"a": ["siren"], "c": ["relu"]})


# -- paired tests


def by_shape(values: np.ndarray) -> dict[str, float]:
    return {f"s{k}": float(value) for k, value in enumerate(values)}


@pytest.mark.parametrize("seed", range(5))
def test_paired_agrees_with_scipy(seed: int) -> None:
    random = np.random.default_rng(seed)
    baseline = random.normal(1.0, 0.3, 20)
    method = baseline + random.normal(0.05, 0.1, 20)
    result = paired_tests(by_shape(method), by_shape(baseline))
    test = stats.ttest_rel(method, baseline)
    assert (result.n, result.delta) == (20, pytest.approx(np.mean(method) - np.mean(baseline)))
    assert result.p_t == pytest.approx(test.pvalue, rel=1e-9)
    assert (result.low, result.high) == pytest.approx(tuple(test.confidence_interval(0.95)), rel=1e-9)
    assert result.p_wilcoxon == pytest.approx(stats.wilcoxon(method, baseline).pvalue, rel=1e-9)


def test_paired_by_hand() -> None:
    # Differences 1, 2, 3: mean 2, standard error 1 / sqrt(3), t = 3.4641 with 2 degrees of freedom.
    result = paired_tests({"a": 2.0, "b": 4.0, "c": 6.0}, {"a": 1.0, "b": 2.0, "c": 3.0})
    assert result.delta == 2.0
    assert result.p_t == pytest.approx(0.0741799, abs=1e-6)
    assert result.high - 2.0 == pytest.approx(4.3026527 / math.sqrt(3), abs=1e-6)
    assert result.p_wilcoxon == 0.25  # 2 of the 2^3 sign patterns are as extreme


def test_a_pair_with_a_missing_side_is_left_out() -> None:
    result = paired_tests({"a": 2.0, "b": NAN, "c": 6.0, "d": 1.0}, {"a": 1.0, "b": 2.0, "c": NAN, "e": 1.0})
    assert (result.n, result.delta) == (1, 1.0)
    assert all(map(math.isnan, (result.low, result.high, result.p_t, result.p_wilcoxon)))
    nothing = paired_tests({"a": NAN}, {"a": 1.0})
    assert nothing.n == 0
    assert math.isnan(nothing.delta)


def test_equal_differences_have_no_t_test() -> None:
    shifted = paired_tests({"a": 1.1, "b": 2.1, "c": 5.1}, {"a": 1.0, "b": 2.0, "c": 5.0})
    assert math.isnan(shifted.p_t)
    assert math.isnan(shifted.low)
    same = paired_tests({"a": 1.0, "b": 2.0}, {"a": 1.0, "b": 2.0})
    assert (same.delta, math.isnan(same.p_t), math.isnan(same.p_wilcoxon)) == (0.0, True, True)


def test_holm_by_hand() -> None:
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([0.9, 0.8]) == [1.0, 1.0]
    assert holm([]) == []
    corrected = holm([0.02, NAN, 0.01])
    assert (corrected[0], corrected[2]) == pytest.approx((0.02, 0.02))
    assert math.isnan(corrected[1])


# -- correlations and quarters


def test_pearson_agrees_with_scipy_and_leaves_missing_pairs_out() -> None:
    random = np.random.default_rng(0)
    x, y = random.normal(size=(2, 12))
    y += x
    result = pearson([*zip(x, y, strict=True), (NAN, 1.0), (1.0, NAN)])
    r, p = stats.pearsonr(x, y)
    assert (result.n, result.r, result.p) == (12, pytest.approx(r), pytest.approx(p))


def test_pearson_of_a_line_is_one_and_of_a_constant_nothing() -> None:
    assert pearson([(1.0, 2.0), (2.0, 0.0), (4.0, -4.0)]).r == pytest.approx(-1.0)
    for pairs in ([(1.0, 2.0), (2.0, 3.0)], [(1.0, 0.3)] * 5, [(1.0, 0.3), (2.0, 0.3), (3.0, 0.3)], []):
        assert math.isnan(pearson(pairs).r)


def test_outer_quarters_are_rounded_down_without_missing_keys() -> None:
    keys = {"a": 5.0, "b": 1.0, "c": 3.0, "d": 2.0, "e": NAN, "f": 4.0, "g": 6.0, "h": 7.0, "i": 8.0, "j": 9.0}
    assert outer_quarters(keys) == (["b", "d"], ["i", "j"])
    assert outer_quarters({"a": 1.0, "b": 2.0, "c": 3.0}) == ([], [])


@pytest.mark.parametrize("seed", range(3))
def test_shared_ranks_and_zeros_are_tested_as_scipy_does(seed: int) -> None:
    random = np.random.default_rng(seed)
    for n in (2, 3, 5, 8):
        differences = random.integers(-3, 4, n).astype(float)
        differences[0] = 1.0
        expected = stats.wilcoxon(differences).pvalue
        assert paired_tests(by_shape(differences), by_shape(np.zeros(n))).p_wilcoxon == expected
