"""The catalogue of ABC shapes."""

from jointsdf.shapes import abc


def test_catalogue_lists_fifty_models() -> None:
    entries = abc.catalogue()
    assert list(entries) == [f"abc_{i:04d}" for i in range(1, 51)]
    assert len({entry.sha256 for entry in entries.values()}) == 50
    assert all(len(entry.sha256) == 64 and entry.abc_id and entry.source for entry in entries.values())
    patches = [entry.patches for entry in entries.values()]
    assert (patches.count(0), patches.count(1)) == (11, 2)
