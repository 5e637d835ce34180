import logging
import math
import re
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy import stats
from study_rows import NAN, line, make_row, make_tables, write

from jointsdf.runs import status as run_state
from jointsdf.runs.records import label_kind, source_of
from jointsdf.runs.row import ResultRow, write_row
from jointsdf.study.__main__ import main
from jointsdf.study.collect import collect
from jointsdf.study.statistics import Summary
from jointsdf.study.tables.latex import best, cell, escape
from jointsdf.study.tables.write import write_tables


def results_with_the_paper(folder: Path) -> Path:
    """Committed results that hold the paper's numbers alone."""
    shutil.copytree(Path(__file__).parents[3] / "results" / "paper", folder / "results" / "paper", dirs_exist_ok=True)
    return folder / "results"


def read(outputs: Path, name: str) -> pd.DataFrame:
    return pd.read_csv(outputs / "tables" / f"{name}.csv")


def tex(outputs: Path, name: str) -> str:
    return (outputs / "tables" / f"{name}.tex").read_text(encoding="utf-8")


# -- collect


@pytest.mark.parametrize(
    ("shape", "source"),
    [
        ("abc_0001", "abc"),
        ("part_01", "builtin"),
        ("bracket-0a1b2c", "file"),
        ("part_01-0a1b2c", "file"),
        ("abc_0001-ffffff", "file"),
        ("abcd", "file"),
    ],
)
def test_source_is_told_by_the_shapes_name(shape: str, source: str) -> None:
    assert source_of(shape) == source


def test_label_kind_drops_the_settings() -> None:
    assert [label_kind(name) for name in ("file:labels.npy", "brep:as-is", "brep", "none")] == [
        "file",
        "brep",
        "brep",
        "none",
    ]


def test_collect_gives_one_line_per_run_and_protocol() -> None:
    row = make_row(cd_l1=0.5, cd_l1_floor=0.25, iou_10=0.5, iou_9=0.25, nc=0.9)
    both = ResultRow(**{**vars(row), "scores": {"unit": row.scores["unit"], "flatcad": {"cd_l1": 0.75}}})
    table = collect([both, make_row(head="deep_skip", cd_l1=1.0, cd_l1_floor=0.0)])
    assert list(table["protocol"]) == ["flatcad", "unit", "unit"]
    assert list(table["head"]) == ["relu", "deep_skip", "relu"]
    unit = table.iloc[2]
    assert unit["cd_l1_over_floor"] == 2.0
    assert table["cd_l1_over_floor"].isna().tolist() == [True, True, False]  # no floor, floor 0
    assert (unit["seconds_fit"], unit["faces_pred"], unit["versions.torch"]) == (2.5, 100, "2.13.0")
    assert (unit["source"], unit["label_provider"], unit["status"], unit["steps"]) == ("abc", "brep", "ok", 10)
    columns = list(table.columns)
    assert columns[:5] == ["study", "variant", "recipe", "protocol", "head"]
    assert columns.index("nc") < columns.index("iou_9") < columns.index("iou_10") < columns.index("seconds_fit")


def test_a_mesh_without_labels_has_no_right_number_of_parts() -> None:
    counts = {"parts_pred": 0.0, "parts_gt": 3.0, "components": 1.0, "components_gt": 1.0}
    rows = [make_row("none", miou=NAN, **counts), make_row("siren", miou=0.0, **counts)]
    table = collect(rows).set_index("head")
    assert math.isnan(table.loc["none", "parts_right"])
    assert table.loc["siren", "parts_right"] == 0
    assert table["pieces_right"].tolist() == [1, 1]


def test_a_run_without_scores_keeps_its_line() -> None:
    row = ResultRow(**{**vars(make_row(status="empty_mesh")), "scores": {}})
    table = collect([row])
    assert (table.loc[0, "protocol"], table.loc[0, "status"]) == ("unit", "empty_mesh")


# -- latex


def test_escape_covers_every_special_character() -> None:
    assert escape("deep_skip & 50% #1 ±") == r"deep\_skip \& 50\% \#1 $\pm$"
    assert (
        escape("a\\b{c}<~^$|") == r"a\textbackslash{}b\{c\}\textless{}\textasciitilde{}\textasciicircum{}\$\textbar{}"
    )


def test_cell_says_when_shapes_are_missing() -> None:
    assert cell(Summary(3, 0.12345, 0.1), digits=3, out_of=3, bold=False) == r"0.123 $\pm$ 0.100"
    assert cell(Summary(2, 0.12345, 0.1), digits=2, out_of=3, bold=True) == r"\textbf{0.12} $\pm$ 0.10 ($n=2$)"
    assert cell(Summary(0, NAN, NAN), digits=2, out_of=3, bold=False) == "--"


def test_best_is_by_direction_as_printed_among_complete_means() -> None:
    summaries = [Summary(2, 0.5001, 0.0), Summary(2, 0.4999, 0.0), Summary(2, 0.7, 0.0), Summary(1, 0.1, 0.0)]
    assert best(summaries, digits=2, out_of=2, goal="low") == [True, True, False, False]
    assert best(summaries, digits=2, out_of=2, goal="high") == [False, False, True, False]
    assert best(summaries, digits=2, out_of=2, goal="none") == [False] * 4
    assert best(summaries[:1], digits=2, out_of=2, goal="low") == [False]


# -- tables against hand computation


@pytest.fixture
def outputs(tmp_path: Path) -> Path:
    """Two heads and the baseline on two common shapes; abc_0003 lacks siren, abc_0004 was run by siren alone."""
    unit = {"cd_l1_floor": 0.2, "components": 1.0, "miou_floor": 0.9, "miou_exact_ceiling": 0.98}
    write(
        tmp_path,
        make_row("relu", "abc_0001", 0, **unit, cd_l1=0.2, nc=0.90, miou=0.5, iou_0=0.4, iou_1=0.6),
        make_row("relu", "abc_0001", 1, **unit, cd_l1=0.4, nc=0.92, miou=0.7, iou_0=0.6, iou_1=0.8),
        make_row("relu", "abc_0002", 0, **unit, cd_l1=0.5, nc=0.95, miou=0.8, iou_0=0.8),
        make_row("relu", "abc_0003", 0, **unit, cd_l1=9.0, nc=0.10, miou=0.1, iou_0=0.1),
        make_row("siren", "abc_0001", 0, **unit, cd_l1=0.2, nc=0.99, miou=0.9, iou_0=0.9, iou_1=0.9),
        make_row("siren", "abc_0002", 0, **unit, cd_l1=0.4, nc=0.89, miou=0.4, iou_0=0.4),
        make_row("siren", "abc_0004", 0, **unit, cd_l1=0.1, nc=0.99, miou=0.9, iou_0=0.9),
        make_row("none", "abc_0001", 0, **unit, provider="none", cd_l1=0.3, nc=0.91),
        make_row("none", "abc_0002", 0, **unit, provider="none", cd_l1=0.3, nc=0.91),
    )
    make_tables(tmp_path)
    return tmp_path


def test_reconstruction_by_hand(outputs: Path) -> None:
    table = read(outputs, "main_reconstruction")
    assert list(table["head"]) == ["none", "relu", "siren"]
    relu = line(table, "relu")  # abc_0001: (0.2 + 0.4) / 2 = 0.3, abc_0002: 0.5
    assert relu["n"] == 2
    assert relu["cd_l1_mean"] == pytest.approx(0.4)
    assert relu["cd_l1_std"] == pytest.approx(math.sqrt(0.02))  # (0.1^2 + 0.1^2) / (2 - 1)
    assert relu["cd_l1_over_floor_mean"] == pytest.approx(2.0)
    assert relu["nc_mean"] == pytest.approx(0.93)
    assert relu["cd_l1_n"] == 2
    assert relu["cd_l2_n"] == 0
    assert math.isnan(relu["cd_l2_mean"])
    assert line(table, "siren")["cd_l1_mean"] == pytest.approx(0.3)
    assert line(table, "none")["cd_l1_std"] == 0.0
    assert set(table["dropped_shapes"]) == {"abc_0003 abc_0004"}


def test_reconstruction_tex_marks_the_best_and_lists_the_dropped(outputs: Path) -> None:
    text = tex(outputs, "main_reconstruction")
    rows = {row.split(" & ")[0]: row for row in text.splitlines() if " & " in row}
    assert r"\textbf{0.300} $\pm$ 0.141" in rows["siren"]  # cd_l1: lowest, a tie with the baseline
    assert r"\textbf{0.300} $\pm$ 0.000" in rows["none"]
    assert r"0.400 $\pm$ 0.141" in rows["relu"]
    assert rows["siren"].count(r"\textbf{0.940}") == 1  # nc: highest
    assert r"\textbf{0.930}" not in text
    assert "0.200" in rows["relu"]
    assert r"\textbf{0.200}" not in text  # the floor is not a competition
    assert r"Left out: abc\_0003 (no none, siren); abc\_0004 (no none, relu)." in text
    assert "1 to 2 seeds averaged first" in text


def test_segmentation_by_hand_has_no_baseline_but_floor_and_ceiling(outputs: Path) -> None:
    table = read(outputs, "main_segmentation")
    assert list(table["head"]) == ["relu", "siren", "floor", "ceiling"]
    assert line(table, "relu")["miou_mean"] == pytest.approx((0.6 + 0.8) / 2)
    assert line(table, "siren")["miou_mean"] == pytest.approx(0.65)
    assert line(table, "siren")["miou_std"] == pytest.approx(math.sqrt(2 * 0.25**2))
    assert line(table, "floor")["miou_mean"] == pytest.approx(0.9)
    assert line(table, "floor")["miou_exact_n"] == 0
    assert line(table, "ceiling")["miou_exact_mean"] == pytest.approx(0.98)
    assert line(table, "ceiling")["miou_n"] == 0
    text = tex(outputs, "main_segmentation")
    assert r"\textit{floor} & 2 & 0.900 $\pm$ 0.000 & --" in text
    assert r"relu & 2 & \textbf{0.700} $\pm$ 0.141" in text


def test_per_part_iou_is_over_the_shapes_that_have_the_part(outputs: Path) -> None:
    table = read(outputs, "per_part_iou")
    relu = table[table["head"] == "relu"].set_index("part")
    assert list(relu["n"]) == [2, 1]
    assert relu.loc[0, "iou_mean"] == pytest.approx((0.5 + 0.8) / 2)
    assert relu.loc[0, "iou_std"] == pytest.approx(math.sqrt(2 * 0.15**2))
    assert relu.loc[1, "iou_mean"] == pytest.approx(0.7)
    assert relu.loc[1, "iou_std"] == 0.0
    assert "none" not in set(table["head"])
    text = tex(outputs, "per_part_iou")
    assert r"$P_{0}$ & 2 & 0.65 $\pm$ 0.21 & 0.65 $\pm$ 0.35" in text.replace(r"\textbf{0.65}", "0.65")
    assert r"$P_{1}$ & 1 & 0.70 $\pm$ 0.00 & \textbf{0.90} $\pm$ 0.00" in text


def test_a_part_that_no_shape_has_is_dashes(tmp_path: Path) -> None:
    write(tmp_path, make_row("relu", miou=1.0, iou_0=1.0, iou_2=0.5))
    make_tables(tmp_path)
    assert r"$P_{1}$ & 0 & --" in tex(tmp_path, "per_part_iou")
    assert read(tmp_path, "per_part_iou")["n"].tolist() == [1, 0, 1]


def test_part_ids_far_apart_are_listed_alone(tmp_path: Path) -> None:
    write(tmp_path, make_row("relu", miou=1.0, iou_7=1.0, iou_100000=0.5))
    make_tables(tmp_path)
    assert read(tmp_path, "per_part_iou")["part"].tolist() == [7, 100000]


def test_an_empty_mesh_is_counted_and_named_and_its_distances_are_not_zero(tmp_path: Path) -> None:
    write(
        tmp_path,
        make_row("relu", "abc_0001", cd_l1=NAN, f1=0.0, miou=0.0, acc=0.0, status="empty_mesh"),
        make_row("relu", "abc_0002", cd_l1=0.1, f1=0.8, miou=0.8, acc=0.8),
        make_row("siren", "abc_0001", cd_l1=0.5, f1=0.6, miou=0.6, acc=0.6),
        make_row("siren", "abc_0002", cd_l1=0.7, f1=0.6, miou=0.6, acc=0.6),
    )
    make_tables(tmp_path)
    relu = line(read(tmp_path, "main_reconstruction"), "relu")
    assert (relu["n"], relu["cd_l1_n"], relu["f1_n"]) == (2, 1, 2)
    assert relu["cd_l1_mean"] == pytest.approx(0.1)
    assert relu["f1_mean"] == pytest.approx(0.4)
    text = tex(tmp_path, "main_reconstruction")
    assert r"relu on abc\_0001 (seed 0, empty\_mesh)" in text
    assert r"0.100 $\pm$ 0.000 ($n=1$)" in text
    assert r"\textbf{0.100}" not in text  # it lost the hard shape: not ranked
    assert "A mean over fewer shapes shows its n and is not ranked." in text


def test_no_common_shape_is_said_not_averaged(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    write(tmp_path, make_row("relu", "abc_0001", cd_l1=1.0), make_row("siren", "abc_0002", cd_l1=1.0))
    make_tables(tmp_path)
    assert read(tmp_path, "main_reconstruction")["n"].tolist() == [0, 0]
    assert "no shape was run with every head (relu, siren); run the missing ones" in caplog.text
    assert r"abc\_0001 (no siren); abc\_0002 (no relu)" in tex(tmp_path, "main_reconstruction")


@pytest.mark.parametrize("change", [{"sha": "new"}, {"provider": "brep:as-is"}, {"parts": 3}])
def test_any_change_of_the_ground_truth_is_named(tmp_path: Path, change: dict[str, str]) -> None:
    write(tmp_path, make_row("relu", nc=0.5), make_row("siren", nc=0.5, **change))  # type: ignore[arg-type]
    make_tables(tmp_path)
    assert r"Ground truth changed between the runs of: abc\_0001." in tex(tmp_path, "main_reconstruction")


def test_settings_that_changed_under_one_name_are_named(tmp_path: Path) -> None:
    rows = [make_row("relu", "abc_0001", nc=0.5), make_row("siren", "abc_0001", nc=0.5)]
    for row, settings in zip(rows, ("old", "new"), strict=True):
        row.provenance["settings_hash"] = settings
    write(tmp_path, *rows, make_row("relu", "abc_0002", nc=0.5), make_row("siren", "abc_0002", nc=0.5))
    make_tables(tmp_path)
    assert "Settings changed between the runs: 2 kinds are mixed here." in tex(tmp_path, "main_reconstruction")
    rows[1].provenance["settings_hash"] = "old"
    write(tmp_path, *rows)
    make_tables(tmp_path)
    assert "Settings changed" not in tex(tmp_path, "main_reconstruction")


def test_a_head_without_any_result_is_named(tmp_path: Path) -> None:
    folders = [tmp_path / "fast" / "base" / head / "abc_0001" / "seed0" for head in ("relu", "siren")]
    run_state.plan(tmp_path / "fast", folders)
    write_row(folders[0], make_row("relu", "abc_0001", nc=0.5))
    (folders[1]).mkdir(parents=True)
    (folders[1] / "result.json").write_text("{")
    make_tables(tmp_path)
    assert r"siren on abc\_0001 (seed0, its result cannot be read)." in tex(tmp_path, "main_reconstruction")
    assert main(["tables", str(tmp_path), "--results", str(tmp_path / "none"), "--heads", "relu"]) == 0
    assert "siren" not in tex(tmp_path, "main_reconstruction")


def test_a_changed_mesh_of_the_baseline_is_named(tmp_path: Path) -> None:
    write(tmp_path, make_row("none", nc=0.5, sha="old"), make_row("relu", nc=0.5, sha="new"))
    make_tables(tmp_path)
    assert r"Ground truth changed between the runs of: abc\_0001." in tex(tmp_path, "paired_reconstruction")


def test_a_long_list_is_cut_short(tmp_path: Path) -> None:
    write(tmp_path, *(make_row("siren", f"abc_{k:04d}", nc=0.5) for k in range(30)), make_row("relu", "abc_0000"))
    make_tables(tmp_path)
    assert r"abc\_0012 (no relu) and 17 more." in tex(tmp_path, "main_reconstruction")


# -- the other tables


@pytest.fixture(scope="module")
def eight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Tables of the baseline and two heads on eight shapes of 2 to 30 parts."""
    tmp_path = tmp_path_factory.mktemp("eight")
    random = np.random.default_rng(7)
    rows = []
    for k, parts in enumerate((2, 4, 5, 8, 9, 18, 19, 30)):
        for head in ("none", "relu", "siren"):
            scores = {"cd_l1": 0.3 + 0.1 * k, "cd_l1_floor": 0.25, "nc": 0.9 - 0.01 * k, "nc_floor": 0.95}
            scores |= {
                "f1": 0.8 - 0.02 * k,
                "f1_floor": 0.8,
                "acc": 0.99 - 0.01 * k,
                "miou_exact": 0.9,
                "acc_exact": 0.95,
            }
            scores |= {"miou": random.uniform(), "consistency": random.uniform()} if head != "none" else {}
            noise = {name: value + random.normal(0, 0.01) for name, value in scores.items() if "floor" not in name}
            rows.append(make_row(head, f"abc_{k:04d}", parts=parts, **(scores | noise)))
    write(tmp_path, *rows)
    make_tables(tmp_path, results_with_the_paper(tmp_path))
    return tmp_path


def values(outputs: Path, head: str, metric: str) -> np.ndarray:
    runs = pd.read_csv(outputs / "tables" / "runs.csv")
    return runs[runs["head"] == head].sort_values("shape")[metric].to_numpy()


def test_paired_table_agrees_with_scipy(eight: Path) -> None:
    table = read(eight, "paired_reconstruction")
    assert set(table["metric"]) == {"cd_l1", "cd_l1_over_floor", "nc", "f1"}
    for metric in ("cd_l1", "nc", "f1"):
        baseline = values(eight, "none", metric)
        lines = table[table["metric"] == metric].set_index("head")
        assert list(lines.index) == ["none", "relu", "siren"]
        assert math.isnan(lines.loc["none", "delta"])
        for head in ("relu", "siren"):
            test = stats.ttest_rel(values(eight, head, metric), baseline)
            assert lines.loc[head, "delta"] == pytest.approx((values(eight, head, metric) - baseline).mean())
            assert lines.loc[head, "p_t"] == pytest.approx(test.pvalue)
            assert lines.loc[head, "p_wilcoxon"] == pytest.approx(
                stats.wilcoxon(values(eight, head, metric), baseline).pvalue
            )
            assert (lines.loc[head, "ci95_low"], lines.loc[head, "ci95_high"]) == pytest.approx(
                tuple(test.confidence_interval(0.95))
            )
        smaller, larger = sorted(lines["p_t"].dropna())
        corrected = sorted(lines["p_t_holm"].dropna())
        assert corrected == pytest.approx([min(1, 2 * smaller), max(min(1, 2 * smaller), larger)])
    text = tex(eight, "paired_reconstruction")
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
    table = read(tmp_path, "paired_reconstruction").set_index(["metric", "head"])
    assert table.loc[("cd_l1", "relu"), ["pairs", "delta"]].tolist() == [3, pytest.approx(0.2)]
    text = tex(tmp_path, "paired_reconstruction")
    assert "Runs of none: study paired." in text
    assert r"Left out: abc\_0003 (no none)." in text
    assert line(read(tmp_path, "main_reconstruction"), "relu")["n"] == 4


def test_every_two_heads_are_compared_on_the_labels_too(eight: Path) -> None:
    table = read(eight, "paired_heads").set_index("metric")
    assert (table["head"] + " - " + table["against"]).unique().tolist() == ["siren - relu"]
    for metric in ("miou", "acc", "consistency", "nc"):
        test = stats.ttest_rel(values(eight, "siren", metric), values(eight, "relu", metric))
        found = table.loc[metric]
        assert (found["pairs"], found["p_t"], found["p_t_holm"]) == (8, *[pytest.approx(test.pvalue)] * 2)
        assert (found["ci95_low"], found["ci95_high"]) == pytest.approx(tuple(test.confidence_interval(0.95)))
    assert "siren $-$ relu" in tex(eight, "paired_heads")


def test_three_heads_give_three_differences_corrected_together(tmp_path: Path) -> None:
    random = np.random.default_rng(3)
    heads = ("hybrid", "relu", "siren")
    write(tmp_path, *(make_row(h, f"abc_{k:04d}", miou=random.uniform()) for h in heads for k in range(6)))
    make_tables(tmp_path)
    table = read(tmp_path, "paired_heads").set_index(["metric", "head", "against"]).loc["miou"]
    assert list(table.index) == [("siren", "relu"), ("hybrid", "relu"), ("hybrid", "siren")]
    least = table["p_t"].min()
    assert table["p_t_holm"].min() == pytest.approx(min(1, 3 * least))
    assert table.loc[("hybrid", "siren"), "delta"] == pytest.approx(
        (values(tmp_path, "hybrid", "miou") - values(tmp_path, "siren", "miou")).mean()
    )


def test_variants_are_compared_with_the_first_on_the_shapes_of_all(tmp_path: Path) -> None:
    def runs(variant: str, offset: float, shapes: int, head: str = "siren") -> list[ResultRow]:
        names = [f"abc_000{k}" for k in range(shapes)]
        return [
            make_row(head, n, study="tap", variant=variant, nc=float(k + offset * (k + 1))) for k, n in enumerate(names)
        ]

    write(tmp_path, *runs("tap=2", 0, 4), *runs("tap=3", 0.5, 3), *runs("tap=10", -1, 4), *runs("tap=11", 9, 4, "relu"))
    make_tables(tmp_path)
    name = "variants--tap-fast-abc-brep-unit"
    table = read(tmp_path, name).set_index(["metric", "head"]).loc["nc"]
    assert list(table.index) == ["siren (tap=2)", "siren (tap=3)", "siren (tap=10)"]  # relu has one variant alone
    assert table["mean"].tolist() == pytest.approx([1, 2, -1])
    assert table["delta"].tolist()[1:] == pytest.approx([1, -2])
    test = stats.ttest_rel([0.5, 2, 3.5], [0, 1, 2])
    assert table.loc["siren (tap=3)", ["pairs", "p_t"]].tolist() == pytest.approx([3, test.pvalue])
    assert table.loc["siren (tap=3)", "p_t_holm"] == pytest.approx(2 * test.pvalue)
    text = tex(tmp_path, name)
    assert table["against"].dropna().unique().tolist() == ["siren (tap=2)"]
    assert "variant tap=2; tap=3; tap=10, ABC" in text
    assert "Each variant minus siren (tap=2) on the same 3 shapes" in text
    assert r"Left out: abc\_0003 (no siren (tap=3))." in text
    assert rf"\input{{{name}.tex}}" in (tmp_path / "tables" / "report.tex").read_text()


def test_a_variant_has_no_tables_of_its_own_unless_a_head_is_in_it_alone(tmp_path: Path) -> None:
    of_main = [make_row("siren", f"abc_000{k}", study="main", nc=1.0) for k in range(3)]
    taps = [make_row("siren", study="tap", variant=f"tap={k}", nc=1.0) for k in (1, 2)]
    write(tmp_path, *of_main, *taps, make_row("relu", study="tap", variant="tap=3", nc=1.0))
    make_tables(tmp_path)
    written = {path.stem for path in (tmp_path / "tables").glob("*.csv")}
    assert {name for name in written if "tap=" in name and name.startswith("main_reconstruction")} == {
        "main_reconstruction--tap-fast-tap=3-abc-brep-unit"
    }
    assert {"main_reconstruction", "variants--tap-fast-abc-brep-unit"} <= written


def test_variants_gone_since_take_their_table_along(tmp_path: Path) -> None:
    write(tmp_path, make_row(variant="a", nc=1.0), make_row(variant="b", nc=1.0))
    make_tables(tmp_path)
    assert list((tmp_path / "tables").glob("variants*.tex"))
    (tmp_path / "run0001" / "result.json").unlink()
    make_tables(tmp_path)
    assert not list((tmp_path / "tables").glob("variants*"))


def test_spread_of_seeds_is_pooled_over_the_shapes_with_several(tmp_path: Path) -> None:
    seeds = {"abc_0001": (0.5, 0.7), "abc_0002": (0.1, 0.2, 0.6), "abc_0003": (9.0,), "abc_0004": (0.5, NAN)}
    rows = [make_row("siren", s, k, miou=v) for s, line in seeds.items() for k, v in enumerate(line)]
    write(tmp_path, *rows, make_row("relu", "abc_0005", 0, miou=0.5), make_row("relu", "abc_0005", 1, miou=0.5))
    make_tables(tmp_path)
    assert line(read(tmp_path, "seeds"), "relu")["miou_std"] == 0
    assert "2 to 3 seeds." in tex(tmp_path, "seeds")
    found = line(read(tmp_path, "seeds"), "siren")
    squares = [np.var(values, ddof=1) * (len(values) - 1) for values in (seeds["abc_0001"], seeds["abc_0002"])]
    assert found["miou_std"] == pytest.approx(math.sqrt(sum(squares) / 3))
    assert (found["miou_n"], found["nc_n"]) == (2, 0)
    assert math.isnan(found["nc_std"])


def test_correlations_agree_with_scipy(eight: Path) -> None:
    table = read(eight, "correlation").set_index(["reconstruction", "segmentation", "head"])
    assert len(table) == 3 * 3 * 3
    for head in ("relu", "siren"):
        r, p = stats.pearsonr(values(eight, head, "cd_l1"), values(eight, head, "miou"))
        assert table.loc[("cd_l1", "miou", head), ["n", "r", "p"]].tolist() == pytest.approx([8, r, p])
    both = [np.concatenate([values(eight, head, name) for head in ("relu", "siren")]) for name in ("nc", "acc")]
    r, p = stats.pearsonr(*both)
    assert table.loc[("nc", "acc", "overall"), ["n", "r", "p"]].tolist() == pytest.approx([16, r, p])
    exact = read(eight, "correlation_exact").set_index(["reconstruction", "segmentation", "head"])
    assert len(exact) == 3 * 2 * 3
    excess = values(eight, "relu", "nc") - values(eight, "relu", "nc_floor")
    r, p = stats.pearsonr(excess, values(eight, "relu", "miou_exact"))
    assert exact.loc[("nc_minus_floor", "miou_exact", "relu"), ["r", "p"]].tolist() == pytest.approx([r, p])
    assert r"CD$_{L1}$/floor $\leftrightarrow$ Acc. exact" in tex(eight, "correlation_exact")


def test_quartiles_are_the_two_shapes_of_eight_at_each_end(eight: Path) -> None:
    table = read(eight, "quartiles").set_index(["head", "quarter"])
    miou, cd_l1 = values(eight, "relu", "miou"), values(eight, "relu", "cd_l1")
    best, worst = table.loc[("relu", "best")], table.loc[("relu", "worst")]
    assert (best["n"], best["shapes"], worst["shapes"]) == (2, "abc_0000 abc_0001", "abc_0006 abc_0007")
    assert best["miou_mean"] == pytest.approx(miou[:2].mean())
    assert worst["miou_std"] == pytest.approx(miou[6:].std(ddof=1))
    assert (worst["low"], worst["high"]) == pytest.approx((cd_l1[6:].min(), cd_l1[6:].max()))
    exact = read(eight, "quartiles_exact").set_index(["by", "head", "quarter"])
    assert set(exact.index.get_level_values("by")) == {"cd_l1_over_floor", "nc_minus_floor", "f1_over_floor"}
    assert exact.loc[("nc_minus_floor", "siren", "best"), "shapes"] == "abc_0000 abc_0001"  # most is best there


def test_part_counts_by_hand(eight: Path) -> None:
    table = read(eight, "part_count").set_index(["parts", "head"])
    assert list(table.index.get_level_values("parts").unique()) == ["2-4", "5-8", "9-18", ">18"]
    assert set(table["n"]) == {2}
    cd_l1 = values(eight, "siren", "cd_l1")
    for place, parts in enumerate(("2-4", "5-8", "9-18", ">18")):
        assert table.loc[(parts, "siren"), "cd_l1_mean"] == pytest.approx(cd_l1[2 * place : 2 * place + 2].mean())
    assert r"$>$" not in tex(eight, "part_count")
    assert r"\textgreater{}18" in tex(eight, "part_count")


def test_worst_names_the_shape_by_the_metrics_own_direction(tmp_path: Path) -> None:
    def run(head: str, k: int, cd_l1: float, nc: float, pieces: float) -> ResultRow:
        floors = {"cd_l1_floor": 0.5, "nc_floor": 0.75}
        return make_row(head, f"abc_000{k}", cd_l1=cd_l1, nc=nc, components=pieces, components_gt=1.0, **floors)

    write(
        tmp_path,
        *(run("relu", 1, 1.0, 0.5, 1.0), run("relu", 2, 1.5, 0.75, 2.0), run("relu", 3, NAN, 0.25, 3.0)),
        *(run("siren", k, 0.5, 1.0, 1.0) for k in (1, 2, 3)),
    )
    make_tables(tmp_path)
    table = read(tmp_path, "worst").set_index(["metric", "head"])
    facts = ["n", "mean", "worst", "shapes"]
    assert table.loc[("cd_l1_over_floor", "relu"), facts].tolist() == [2, 2.5, 3.0, "abc_0002"]
    assert table.loc[("nc_minus_floor", "relu"), facts].tolist() == [3, -0.25, -0.5, "abc_0003"]
    assert table.loc[("pieces_right", "relu"), facts].tolist() == [3, pytest.approx(1 / 3), 0.0, "abc_0002 abc_0003"]
    assert table.loc[("pieces_right", "siren"), ["n", "mean", "worst"]].tolist() == [3, 1.0, 1.0]
    assert (table.loc[("parts_right", "relu"), "n"], table.loc[("acc_exact", "relu"), "n"]) == (0, 0)
    text = tex(tmp_path, "worst")
    assert r"relu & 1 of 3 & -- & abc\_0002, abc\_0003" in text
    assert "siren & 3 of 3 & -- & --" in text


def test_cost_names_the_machine(eight: Path) -> None:
    table = read(eight, "cost")
    assert set(table["seconds_fit_mean"]) == {2.5}
    assert set(table["peak_memory_mb_mean"]) == {100.0}
    assert "Measured on: a machine; on cpu; threads: 2." in tex(eight, "cost")


def test_against_paper_has_both_numbers_and_names_both_origins(eight: Path) -> None:
    table = read(eight, "against_paper").set_index(["metric", "head"])
    hybrid, relu = table.loc[("cd_l1", "hybrid")], table.loc[("cd_l1", "relu")]
    assert (relu["paper_mean"], relu["paper_std"], relu["floor_mean"]) == (0.59, 1.30, 0.25)
    assert relu["mean"] == pytest.approx(values(eight, "relu", "cd_l1").mean())
    assert (hybrid["paper_mean"], hybrid["n"]) == (0.49, 0)
    assert table.loc[("consistency", "siren"), "paper_mean"] == 0.97
    text = tex(eight, "against_paper")
    for said in ("PartField labels", "protocol unit", "recipe fast", "brep labels", "ABC shapes", r"0.59 $\pm$ 1.30"):
        assert said in text


def test_built_in_shapes_are_not_held_against_the_paper(tmp_path: Path) -> None:
    write(tmp_path, make_row("relu", "part_01", cd_l1=1.0), make_row("siren", "part_01", cd_l1=1.0))
    assert not [
        path for path in make_tables(tmp_path, results_with_the_paper(tmp_path)) if "against_paper" in path.name
    ]


def test_failed_and_missing_runs_are_in_the_caption(tmp_path: Path) -> None:
    folders = [
        tmp_path / "main" / "base" / head / f"abc_000{k}" / "seed0" for head in ("relu", "siren") for k in (1, 2)
    ]
    run_state.plan(tmp_path / "main", folders)
    write_row(folders[0], make_row("relu", "abc_0001", study="main", cd_l1=0.5))
    write_row(folders[2], make_row("siren", "abc_0001", study="main", cd_l1=0.5))
    run_state.fail(folders[1], "no memory", MemoryError("no memory"))
    make_tables(tmp_path)
    text = tex(tmp_path, "main_reconstruction")
    assert "relu on abc\\_0002 (seed0, failed: no memory), siren on abc\\_0002 (seed0, missing)." in text


@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="no TeX here")
def test_the_report_compiles_with_every_table(eight: Path) -> None:
    assert main(["report", str(eight), "--results", str(results_with_the_paper(eight))]) == 0
    assert (eight / "tables" / "report.pdf").read_bytes().startswith(b"%PDF")
    text = (eight / "tables" / "report.tex").read_text()
    for path in (eight / "tables").glob("*.tex"):
        assert path.name == "report.tex" or rf"\input{{{path.name}}}" in text


def test_no_tex_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> None:
    write(tmp_path, make_row(cd_l1=1.0))
    monkeypatch.setenv("PATH", "")
    assert main(["report", str(tmp_path), "--results", str(tmp_path / "none")]) == 2
    assert "report.tex is written, its PDF is not: no TeX found" in caplog.records[-1].getMessage()


# -- groups


@pytest.mark.parametrize(
    ("changed", "suffix"),
    [
        ({"study": "wide"}, "wide-fast-base-abc-brep-unit"),
        ({"recipe": "points"}, "fast-points-base-abc-brep-unit"),
        ({"variant": "loss.weights.weingarten=0"}, "fast-loss.weights.weingarten=0-abc-brep-unit"),
        ({"provider": "file:labels.npy"}, "fast-base-abc-file-unit"),
        ({"shape": "part_01"}, "fast-base-builtin-brep-unit"),
        ({"protocol": "flatcad"}, "fast-base-abc-brep-flatcad"),
    ],
)
def test_what_differs_is_never_in_one_table(tmp_path: Path, changed: dict[str, str], suffix: str) -> None:
    other = {"shape": "abc_0009", **changed}
    write(
        tmp_path,
        make_row("relu", "abc_0001", cd_l1=1.0),
        make_row("relu", "abc_0002", cd_l1=3.0, provider="brep:as-is"),
        make_row("relu", cd_l1=100.0, **other),  # type: ignore[arg-type]
    )
    make_tables(tmp_path)
    assert line(read(tmp_path, "main_reconstruction"), "relu")["cd_l1_mean"] == 2.0
    assert line(read(tmp_path, f"main_reconstruction--{suffix}"), "relu")["cd_l1_mean"] == 100.0
    assert len(list((tmp_path / "tables").glob("main_reconstruction*.tex"))) == 2


def test_one_group_has_plain_names_and_old_tables_go(tmp_path: Path) -> None:
    scores = {"cd_l1": 1.0, "miou": 1.0, "iou_0": 1.0}
    write(tmp_path, make_row("relu", **scores), make_row("relu", recipe="points", **scores))
    make_tables(tmp_path)
    tables = tmp_path / "tables"
    (tables / "mine.tex").write_text("kept")
    assert len(list(tables.glob("*--*"))) == 12
    (tmp_path / "run0001" / "result.json").unlink()
    written = make_tables(tmp_path)
    made = ("main_reconstruction", "main_segmentation", "worst", "per_part_iou", "part_count", "cost")
    names = {f"{name}.{ending}" for name in made for ending in ("csv", "tex")} | {"runs.csv", "report.tex"}
    assert {path.name for path in written} == names
    assert {path.name for path in tables.iterdir()} == names | {"mine.tex"}


def test_the_default_group_is_protocol_unit_however_few_its_rows(tmp_path: Path) -> None:
    flatcad = [make_row("relu", f"abc_000{k}", cd_l1=5.0, protocol="flatcad") for k in (2, 3)]
    write(tmp_path, make_row("relu", "abc_0001", cd_l1=1.0), *flatcad)
    make_tables(tmp_path)
    assert line(read(tmp_path, "main_reconstruction"), "relu")["protocol"] == "unit"


def test_the_baseline_alone_has_tables_of_reconstruction_only(tmp_path: Path) -> None:
    write(tmp_path, make_row("none", cd_l1=1.0, miou=NAN))
    made = {path.name for path in make_tables(tmp_path)}
    names = {f"{name}.{ending}" for name in ("main_reconstruction", "cost") for ending in ("csv", "tex")}
    assert made == names | {"runs.csv", "report.tex"}


# -- form


def test_every_tex_is_balanced_booktabs(outputs: Path) -> None:
    files = [path for path in (outputs / "tables").glob("*.tex") if path.stem != "report"]
    assert {"paired_reconstruction", "correlation", "part_count", "cost"} < {path.stem for path in files}
    for path in files:
        text = path.read_text(encoding="utf-8")
        bare = re.sub(r"\\[{}]", "", text)
        assert bare.count("{") == bare.count("}")
        assert text.count("$") % 2 == 0
        assert [text.count(rule) for rule in (r"\toprule", r"\midrule", r"\bottomrule", r"\caption{")] == [1, 1, 1, 1]
        assert text.count(r"\begin{") == text.count(r"\end{") == 2
        columns = len(re.search(r"\\begin\{tabular\}\{(\w+)\}", text)[1])  # type: ignore[index]
        rows = [row for row in text.splitlines() if row.endswith(r"\\")]
        assert {row.count(" & ") + 1 for row in rows} == {columns}
        outside_math = re.sub(r"\$[^$]*\$", "", re.sub(r"\\_", "", text))
        assert "_" not in outside_math
        assert text.isascii()


def test_the_command_writes_and_names_the_tables(
    outputs: Path, caplog: pytest.LogCaptureFixture, capsys: pytest.CaptureFixture[str]
) -> None:
    (outputs / "broken").mkdir()
    (outputs / "broken" / "result.json").write_text("{")
    with caplog.at_level(logging.INFO):
        assert main(["tables", str(outputs), "--results", str(outputs / "none")]) == 0
    assert str(outputs / "tables" / "main_reconstruction.tex") in caplog.text
    assert "broken" in caplog.text
    assert "Traceback" not in capsys.readouterr().err


def test_tables_of_some_heads_are_over_the_shapes_that_these_share(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    write(tmp_path, *(make_row("siren", f"abc_000{k}", cd_l1=1.0) for k in range(3)), make_row("relu", "abc_0001"))
    command = ["tables", str(tmp_path), "--results", str(tmp_path / "none")]
    assert main([*command, "--heads", "siren"]) == 0
    assert line(read(tmp_path, "main_reconstruction"), "siren")["n"] == 3
    assert main(command) == 0
    assert line(read(tmp_path, "main_reconstruction"), "siren")["n"] == 1
    assert main([*command, "--heads", "siren,none"]) == 2
    assert caplog.records[-1].getMessage() == "heads: no row of 'none'; there are rows of relu, siren"


@pytest.mark.parametrize("folder", ["", "missing"])
def test_no_rows_is_one_line_and_exit_code_2(tmp_path: Path, folder: str, caplog: pytest.LogCaptureFixture) -> None:
    assert main(["tables", str(tmp_path / folder), "--results", str(tmp_path / "none")]) == 2
    (record,) = caplog.records
    assert "no result rows below it; make one with `python train.py`" in record.getMessage()
    assert "\n" not in record.getMessage()
    assert list(tmp_path.iterdir()) == []


def test_a_thousand_runs_are_counted_by_shape(tmp_path: Path) -> None:
    scores = {f"iou_{part}": 0.5 for part in range(18)} | {"cd_l1": 0.3, "nc": 0.9, "miou": 0.8}
    heads = ("none", "relu", "siren", "hybrid", "deep_skip")
    rows = [make_row(head, f"abc_{k:04d}", seed, **scores) for head in heads for k in range(50) for seed in range(4)]
    write_tables(rows, tmp_path, tmp_path)
    assert line(read(tmp_path, "main_segmentation"), "hybrid")["n"] == 50
