"""Correlations and outer quarters against scipy."""

from pathlib import Path

import numpy as np
import pytest
from scipy import stats
from study_rows import read_table, read_tex, values_of


def test_correlations_agree_with_scipy(eight: Path) -> None:
    table = read_table(eight, "correlation").set_index(["reconstruction", "segmentation", "head"])
    assert len(table) == 3 * 3 * 3
    for head in ("relu", "siren"):
        r, p = stats.pearsonr(values_of(eight, head, "cd_l1"), values_of(eight, head, "miou"))
        assert table.loc[("cd_l1", "miou", head), ["n", "r", "p"]].tolist() == pytest.approx([8, r, p])
    both = [np.concatenate([values_of(eight, head, name) for head in ("relu", "siren")]) for name in ("nc", "acc")]
    r, p = stats.pearsonr(*both)
    assert table.loc[("nc", "acc", "overall"), ["n", "r", "p"]].tolist() == pytest.approx([16, r, p])
    exact = read_table(eight, "correlation_exact").set_index(["reconstruction", "segmentation", "head"])
    assert len(exact) == 3 * 2 * 3
    excess = values_of(eight, "relu", "nc") - values_of(eight, "relu", "nc_floor")
    r, p = stats.pearsonr(excess, values_of(eight, "relu", "miou_exact"))
    assert exact.loc[("nc_minus_floor", "miou_exact", "relu"), ["r", "p"]].tolist() == pytest.approx([r, p])
    assert r"CD$_{L1}$/floor $\leftrightarrow$ Acc. exact" in read_tex(eight, "correlation_exact")


def test_quartiles_are_the_two_shapes_of_eight_at_each_end(eight: Path) -> None:
    table = read_table(eight, "quartiles").set_index(["head", "quarter"])
    miou, cd_l1 = values_of(eight, "relu", "miou"), values_of(eight, "relu", "cd_l1")
    best, worst = table.loc[("relu", "best")], table.loc[("relu", "worst")]
    assert (best["n"], best["shapes"], worst["shapes"]) == (2, "abc_0000 abc_0001", "abc_0006 abc_0007")
    assert best["miou_mean"] == pytest.approx(miou[:2].mean())
    assert worst["miou_std"] == pytest.approx(miou[6:].std(ddof=1))
    assert (worst["low"], worst["high"]) == pytest.approx((cd_l1[6:].min(), cd_l1[6:].max()))
    exact = read_table(eight, "quartiles_exact").set_index(["by", "head", "quarter"])
    assert set(exact.index.get_level_values("by")) == {"cd_l1_over_floor", "nc_minus_floor", "f1_over_floor"}
    assert exact.loc[("nc_minus_floor", "siren", "best"), "shapes"] == "abc_0000 abc_0001"  # most is best there
