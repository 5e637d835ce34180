"""Paired differences against scipy."""

import math
from pathlib import Path

import numpy as np
import pytest
from scipy import stats
from study_rows import line, make_row, make_tables, read_table, read_tex, values_of, write

from jointsdf.runs.row import ResultRow


def test_paired_table_agrees_with_scipy(eight: Path) -> None:
    table = read_table(eight, "paired_reconstruction")
    assert set(table["metric"]) == {"cd_l1", "cd_l1_over_floor", "nc", "f1"}
    for metric in ("cd_l1", "nc", "f1"):
        baseline = values_of(eight, "none", metric)
        lines = table[table["metric"] == metric].set_index("head")
        assert list(lines.index) == ["none", "relu", "siren"]
        assert math.isnan(lines.loc["none", "delta"])
        for head in ("relu", "siren"):
            test = stats.ttest_rel(values_of(eight, head, metric), baseline)
            assert lines.loc[head, "delta"] == pytest.approx((values_of(eight, head, metric) - baseline).mean())
            assert lines.loc[head, "p_t"] == pytest.approx(test.pvalue)
            assert lines.loc[head, "p_wilcoxon"] == pytest.approx(
                stats.wilcoxon(values_of(eight, head, metric), baseline).pvalue
            )
            assert (lines.loc[head, "ci95_low"], lines.loc[head, "ci95_high"]) == pytest.approx(
                tuple(test.confidence_interval(0.95))
            )
        smaller, larger = sorted(lines["p_t"].dropna())
        corrected = sorted(lines["p_t_holm"].dropna())
        assert corrected == pytest.approx([min(1, 2 * smaller), max(min(1, 2 * smaller), larger)])
    text = read_tex(eight, "paired_reconstruction")
    assert "on the same 8 shapes" in text
    assert text.count(r"\addlinespace") == 3


def test_a_baseline_of_another_study_is_borrowed_for_the_paired_table_alone(tmp_path: Path) -> None:
    write(
        tmp_path,
        *(make_row("relu", f"abc_{k:04d}", study="main", cd_l1=0.5 + 0.1 * k, miou=0.5) for k in range(4)),
        *(make_row("none", f"abc_{k:04d}", study="paired", provider="none", cd_l1=0.4) for k in range(3)),
        *(
            make_row("none", f"abc_{k:04d}", study="other", provider="none", recipe="points", cd_l1=9.0)
            for k in range(4)
        ),
    )
    make_tables(tmp_path)
    table = read_table(tmp_path, "paired_reconstruction").set_index(["metric", "head"])
    assert table.loc[("cd_l1", "relu"), ["pairs", "delta"]].tolist() == [3, pytest.approx(0.2)]
    text = read_tex(tmp_path, "paired_reconstruction")
    assert "Runs of none: study paired." in text
    assert r"Left out: abc\_0003 (no none)." in text
    assert line(read_table(tmp_path, "main/main_reconstruction"), "relu")["n"] == 4


def test_every_two_heads_are_compared_on_the_labels_too(eight: Path) -> None:
    table = read_table(eight, "paired_heads").set_index("metric")
    assert (table["head"] + " - " + table["against"]).unique().tolist() == ["siren - relu"]
    for metric in ("miou", "acc", "consistency", "nc"):
        test = stats.ttest_rel(values_of(eight, "siren", metric), values_of(eight, "relu", metric))
        found = table.loc[metric]
        assert (found["pairs"], found["p_t"], found["p_t_holm"]) == (8, *[pytest.approx(test.pvalue)] * 2)
        assert (found["ci95_low"], found["ci95_high"]) == pytest.approx(tuple(test.confidence_interval(0.95)))
    assert "siren $-$ relu" in read_tex(eight, "paired_heads")


def test_three_heads_give_three_differences_corrected_together(tmp_path: Path) -> None:
    random = np.random.default_rng(3)
    heads = ("hybrid", "relu", "siren")
    write(tmp_path, *(make_row(h, f"abc_{k:04d}", miou=random.uniform()) for h in heads for k in range(6)))
    make_tables(tmp_path)
    table = read_table(tmp_path, "paired_heads").set_index(["metric", "head", "against"]).loc["miou"]
    assert list(table.index) == [("siren", "relu"), ("hybrid", "relu"), ("hybrid", "siren")]
    least = table["p_t"].min()
    assert table["p_t_holm"].min() == pytest.approx(min(1, 3 * least))
    assert table.loc[("hybrid", "siren"), "delta"] == pytest.approx(
        (values_of(tmp_path, "hybrid", "miou") - values_of(tmp_path, "siren", "miou")).mean()
    )


def test_variants_are_compared_as_distances_where_their_rows_have_them(tmp_path: Path) -> None:
    def runs(variant: str, angle: float) -> list[ResultRow]:
        scores = {"nc": 0.9, "gradient_angle_median": angle}
        return [make_row("siren", f"abc_000{k}", study="far", variant=variant, **scores) for k in range(3)]

    write(tmp_path, *runs("grid", 0.25), *runs("none", 2.5))
    make_tables(tmp_path)
    table = read_table(tmp_path, "variants--far-fast-abc-brep-unit").set_index(["metric", "head"])
    assert table.loc[("gradient_angle_median", "siren (none)"), "delta"] == pytest.approx(2.25)
    assert "sdf_ratio" not in table.index.get_level_values("metric")


def test_variants_are_compared_with_the_first_on_the_shapes_of_all(tmp_path: Path) -> None:
    def runs(variant: str, offset: float, shapes: int, head: str = "siren") -> list[ResultRow]:
        names = [f"abc_000{k}" for k in range(shapes)]
        return [
            make_row(head, n, study="tap", variant=variant, nc=float(k + offset * (k + 1))) for k, n in enumerate(names)
        ]

    write(tmp_path, *runs("tap=2", 0, 4), *runs("tap=3", 0.5, 3), *runs("tap=10", -1, 4), *runs("tap=11", 9, 4, "relu"))
    make_tables(tmp_path)
    name = "variants--tap-fast-abc-brep-unit"
    table = read_table(tmp_path, name).set_index(["metric", "head"]).loc["nc"]
    assert list(table.index) == ["siren (tap=2)", "siren (tap=3)", "siren (tap=10)"]  # relu has one variant alone
    assert table["mean"].tolist() == pytest.approx([1, 2, -1])
    assert table["delta"].tolist()[1:] == pytest.approx([1, -2])
    test = stats.ttest_rel([0.5, 2, 3.5], [0, 1, 2])
    assert table.loc["siren (tap=3)", ["pairs", "p_t"]].tolist() == pytest.approx([3, test.pvalue])
    assert table.loc["siren (tap=3)", "p_t_holm"] == pytest.approx(2 * test.pvalue)
    text = read_tex(tmp_path, name)
    assert table["against"].dropna().unique().tolist() == ["siren (tap=2)"]
    assert "variant tap=2; tap=3; tap=10, ABC" in text
    assert "Each variant minus siren (tap=2) on the same 3 shapes" in text
    assert r"Left out: abc\_0003 (no siren (tap=3))." in text
    assert rf"\input{{tap/{name}.tex}}" in (tmp_path / "tables" / "report.tex").read_text()
