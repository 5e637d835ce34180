"""Variants of a study share a table."""

from pathlib import Path

from study_rows import make_row, make_tables, write


def test_a_variant_has_no_tables_of_its_own_unless_a_head_is_in_it_alone(tmp_path: Path) -> None:
    of_main = [make_row("siren", f"abc_000{k}", study="main", nc=1.0) for k in range(3)]
    taps = [make_row("siren", study="tap", variant=f"tap={k}", nc=1.0) for k in (1, 2)]
    write(tmp_path, *of_main, *taps, make_row("relu", study="tap", variant="tap=3", nc=1.0))
    make_tables(tmp_path)
    written = {path.stem for path in (tmp_path / "tables").rglob("*.csv")}
    assert {name for name in written if "tap=" in name and name.startswith("main_reconstruction")} == {
        "main_reconstruction--tap-fast-tap=3-abc-brep-unit"
    }
    assert {"main_reconstruction", "variants--tap-fast-abc-brep-unit"} <= written


def test_variants_gone_since_take_their_table_along(tmp_path: Path) -> None:
    write(tmp_path, make_row(variant="a", nc=1.0), make_row(variant="b", nc=1.0))
    make_tables(tmp_path)
    assert list((tmp_path / "tables").rglob("variants*.tex"))
    (tmp_path / "run0001" / "result.json").unlink()
    make_tables(tmp_path)
    assert not list((tmp_path / "tables").rglob("variants*"))
