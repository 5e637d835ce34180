"""Captions name the runs that a table leaves out or mixes."""

from pathlib import Path

import pytest
from study_rows import NAN, line, make_row, make_tables, read_table, read_tex, write


def test_an_empty_mesh_is_counted_and_named_and_its_distances_are_not_zero(tmp_path: Path) -> None:
    write(
        tmp_path,
        make_row("relu", "abc_0001", cd_l1=NAN, f1=0.0, miou=0.0, acc=0.0, status="empty_mesh"),
        make_row("relu", "abc_0002", cd_l1=0.1, f1=0.8, miou=0.8, acc=0.8),
        make_row("siren", "abc_0001", cd_l1=0.5, f1=0.6, miou=0.6, acc=0.6),
        make_row("siren", "abc_0002", cd_l1=0.7, f1=0.6, miou=0.6, acc=0.6),
    )
    make_tables(tmp_path)
    relu = line(read_table(tmp_path, "main_reconstruction"), "relu")
    assert (relu["n"], relu["cd_l1_n"], relu["f1_n"]) == (2, 1, 2)
    assert relu["cd_l1_mean"] == pytest.approx(0.1)
    assert relu["f1_mean"] == pytest.approx(0.4)
    text = read_tex(tmp_path, "main_reconstruction")
    assert r"relu on abc\_0001 (seed 0, empty\_mesh)" in text
    assert r"0.100 ($n=1$)" in text
    assert r"\textbf{0.100}" not in text  # it lost the hard shape: not ranked
    assert "A mean over fewer shapes shows its n and is not ranked." in text


def test_no_common_shape_is_said_not_averaged(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    write(tmp_path, make_row("relu", "abc_0001", cd_l1=1.0), make_row("siren", "abc_0002", cd_l1=1.0))
    make_tables(tmp_path)
    assert read_table(tmp_path, "main_reconstruction")["n"].tolist() == [0, 0]
    assert "no shape was run with every head (relu, siren); run the missing ones" in caplog.text
    assert r"abc\_0001 (no siren); abc\_0002 (no relu)" in read_tex(tmp_path, "main_reconstruction")


@pytest.mark.parametrize("change", [{"sha": "new"}, {"provider": "brep:as-is"}, {"parts": 3}])
def test_any_change_of_the_ground_truth_is_named(tmp_path: Path, change: dict[str, str]) -> None:
    write(tmp_path, make_row("relu", nc=0.5), make_row("siren", nc=0.5, **change))  # type: ignore[arg-type]
    make_tables(tmp_path)
    assert r"Ground truth changed between the runs of: abc\_0001." in read_tex(tmp_path, "main_reconstruction")


def test_settings_that_changed_under_one_name_are_named(tmp_path: Path) -> None:
    rows = [make_row("relu", "abc_0001", nc=0.5), make_row("siren", "abc_0001", nc=0.5)]
    for row, settings in zip(rows, ("old", "new"), strict=True):
        row.provenance["settings_hash"] = settings
    write(tmp_path, *rows, make_row("relu", "abc_0002", nc=0.5), make_row("siren", "abc_0002", nc=0.5))
    make_tables(tmp_path)
    assert "Settings changed between the runs: 2 kinds are mixed here." in read_tex(tmp_path, "main_reconstruction")
    rows[1].provenance["settings_hash"] = "old"
    write(tmp_path, *rows)
    make_tables(tmp_path)
    assert "Settings changed" not in read_tex(tmp_path, "main_reconstruction")


def test_a_changed_mesh_of_the_baseline_is_named(tmp_path: Path) -> None:
    write(tmp_path, make_row("none", nc=0.5, sha="old"), make_row("relu", nc=0.5, sha="new"))
    make_tables(tmp_path)
    assert r"Ground truth changed between the runs of: abc\_0001." in read_tex(tmp_path, "paired_reconstruction")


def test_a_long_list_is_cut_short(tmp_path: Path) -> None:
    write(tmp_path, *(make_row("siren", f"abc_{k:04d}", nc=0.5) for k in range(30)), make_row("relu", "abc_0000"))
    make_tables(tmp_path)
    assert r"abc\_0012 (no relu) and 17 more." in read_tex(tmp_path, "main_reconstruction")


def test_corruptions_of_the_training_clouds_are_named(tmp_path: Path) -> None:
    rows = [make_row("relu", nc=0.5), make_row("siren", nc=0.5)]
    write(tmp_path, *rows)
    make_tables(tmp_path)
    assert "Corruption" not in read_tex(tmp_path, "main_reconstruction")
    rows[0].provenance["corruption"] = "noise=0.005"
    write(tmp_path, *rows)
    make_tables(tmp_path)
    assert "Corruption of the training cloud: noise=0.005; none." in read_tex(tmp_path, "main_reconstruction")
