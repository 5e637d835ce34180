"""Source and label kind by name."""

import pytest

from jointsdf.runs.records import label_kind, source_of


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
