"""Members of whole, damaged and hostile 7z archives."""

import errno
import io
import re
import sys
from pathlib import Path

import py7zr
import pytest
from abc_files import FILES, OBJ, YML, filled, seven_zip

from jointsdf.abc_dataset import archive, members
from jointsdf.errors import InputError


def take(path: Path, folder: Path) -> list[str]:
    return [each.name for each in archive.extract(path, lambda name: members.parse_name(name) is not None, folder)]


@pytest.mark.parametrize("blocks", [False, True])
def test_only_what_is_needed_is_taken_out(tmp_path: Path, blocks: bool) -> None:
    inside = {f"00000007/{OBJ}": FILES[OBJ], "00000007/other.txt": b"1", f"00000007/{YML}": FILES[YML], "last": b"2"}
    path = seven_zip(tmp_path / "some.7z", inside, blocks=blocks)
    assert sorted(take(path, tmp_path / "in")) == sorted(FILES)
    assert {each.name: each.read_bytes() for each in (tmp_path / "in").iterdir()} == FILES


@pytest.mark.parametrize("name", ["../../x", "a/../../x", "/x", "C:x", "..\\x", "a\\..\\x", "\\x", ".."])
def test_a_member_outside_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    monkeypatch.setattr(py7zr.SevenZipFile, "_sanitize_archive_arcname", staticmethod(lambda name: name))
    monkeypatch.setattr(sys.modules["py7zr.py7zr"], "check_archive_path", lambda _: True)
    path = seven_zip(filled(tmp_path / "deep", {}) / "hostile.7z", {**FILES, name: b"x"})
    shown = repr(name.replace("\\", "/"))  # as the reader gives it
    with pytest.raises(InputError, match=f"{re.escape(shown)}.*nothing is taken"):
        take(path, tmp_path / "deep" / "in")
    assert [each.name for each in tmp_path.rglob("*") if each.is_file()] == ["hostile.7z"]


def test_names_with_dots_are_inside(tmp_path: Path) -> None:
    assert sorted(take(seven_zip(tmp_path / "some.7z", {**FILES, "a..b/c...": b"", "...": b"x"}), tmp_path)) == sorted(
        FILES
    )


def test_a_link_is_refused(tmp_path: Path) -> None:
    (tmp_path / "aim").write_text("secret")
    (tmp_path / OBJ).symlink_to("aim")
    with py7zr.SevenZipFile(tmp_path / "some.7z", "w") as opened:
        opened.write(tmp_path / "aim", "aim")
        opened.write(tmp_path / OBJ, OBJ)
    with pytest.raises(InputError, match="a link"):
        take(tmp_path / "some.7z", tmp_path / "in")


def test_too_large_a_member_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = seven_zip(tmp_path / "some.7z", FILES)
    monkeypatch.setattr(archive, "MEMBER_LIMIT", len(FILES[OBJ]) - 1)
    with pytest.raises(InputError, match=f"{OBJ}' of {len(FILES[OBJ])} bytes"):
        take(path, tmp_path / "in")
    monkeypatch.setattr(archive, "MEMBER_LIMIT", max(map(len, FILES.values())))
    assert len(take(path, tmp_path / "in")) == 2


def test_an_archive_that_unpacks_to_too_much_is_refused(tmp_path: Path) -> None:
    path = seven_zip(tmp_path / "bomb.7z", {**FILES, "zeros": bytes(archive.ARCHIVE_LIMIT)})
    with pytest.raises(InputError, match="would unpack to"):
        take(path, tmp_path / "in")
    assert not (tmp_path / "in").exists()


def test_a_damaged_archive_is_named_and_leaves_nothing(tmp_path: Path) -> None:
    whole = seven_zip(tmp_path / "whole.7z", FILES).read_bytes()
    middle = bytes([whole[60] ^ 255])
    damaged = {
        "empty": b"",
        "cut": whole[: len(whole) // 2],
        "short": whole[:20],
        "text": b"<html>" * 100,
        "flipped": whole[:60] + middle + whole[61:],
        "header": whole[:-5] + bytes([whole[-5] ^ 255]) + whole[-4:],
    }
    for name, data in damaged.items():
        path = tmp_path / f"{name}.7z"
        path.write_bytes(data)
        with pytest.raises(InputError, match=f"{name}.7z.*download it again") as refused:
            take(path, tmp_path / "in")
        assert "\n" not in str(refused.value)
        assert list((tmp_path / "in").rglob("*")) == []


def test_a_full_disk_while_unpacking(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = seven_zip(tmp_path / "some.7z", FILES)

    class FullDisk(io.FileIO):
        def write(self, data: bytes) -> int:
            super().write(data[:5])
            raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "open", lambda path, mode: FullDisk(path, mode))
    with pytest.raises(InputError, match="the disk is full"):
        take(path, tmp_path / "in")
    assert list((tmp_path / "in").iterdir()) == []


def test_without_the_7z_reader_the_line_says_how_to_get_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(archive.importlib.util, "find_spec", lambda _: None)
    with pytest.raises(InputError, match=r"pip install.*\[abc\]"):
        take(tmp_path / "some.7z", tmp_path)
