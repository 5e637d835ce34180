"""A file is replaced whole or not at all, and is on the disk before it takes the old one's place."""

import errno
import os
import stat
import threading
from contextlib import nullcontext
from pathlib import Path

import pytest

from jointsdf.runs.files import replacing, sweep_temporaries, write_atomically


@pytest.mark.parametrize("existing", [True, False])
def test_a_failing_block_leaves_the_old_file_and_no_temporary_one(tmp_path: Path, existing: bool) -> None:
    path = tmp_path / "file.txt"
    if existing:
        path.write_text("old")

    def write_half() -> None:
        with replacing(path) as temporary:
            temporary.write_text("new and incompl")
            raise RuntimeError("half-way")

    with pytest.raises(RuntimeError, match="half-way"):
        write_half()
    assert [entry.name for entry in tmp_path.iterdir()] == ["file.txt"] * existing
    assert not existing or path.read_text() == "old"


def test_the_temporary_file_is_in_the_same_folder_and_becomes_the_file(tmp_path: Path) -> None:
    path = tmp_path / "new" / "folder" / "file.bin"
    with replacing(path) as temporary:
        assert temporary.parent == path.parent
        temporary.write_bytes(b"\0\xff")
        assert not path.exists()
    assert path.read_bytes() == b"\0\xff"
    assert list(path.parent.iterdir()) == [path]


def test_a_reader_sees_the_old_file_or_the_new_one(tmp_path: Path) -> None:
    path, size = tmp_path / "file.bin", 200_000
    versions = [bytes([number]) * size for number in range(4)]
    write_atomically(path, versions[0])
    stop, torn = threading.Event(), []

    def look() -> None:
        while not stop.is_set():
            content = path.read_bytes()
            if content not in versions:
                torn.append(len(content))

    reader = threading.Thread(target=look)
    reader.start()
    for number in range(60):
        write_atomically(path, versions[number % 4])
    stop.set()
    reader.join()
    assert torn == []


@pytest.mark.parametrize(
    ("content", "stored"),
    [
        ("ä\nb\r\n", b"\xc3\xa4\nb\r\n"),
        ("a file's \udcff name", rb"a file's \udcff name"),
        (b"\r\n\0", b"\r\n\0"),
        ("", b""),
    ],
)
def test_text_is_utf_8_with_line_feeds_and_bytes_are_as_given(tmp_path: Path, content: str | bytes, stored) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"old and longer than the new one")
    write_atomically(path, content)
    assert path.read_bytes() == stored


def test_the_content_is_flushed_to_the_disk_before_the_file_is_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[tuple[str, str]] = []
    fsync, replace = os.fsync, os.replace

    def flushed(descriptor: int) -> None:
        calls.append(("fsync", Path(f"/proc/self/fd/{descriptor}").resolve().name))
        fsync(descriptor)

    def replaced(source: Path, target: Path) -> None:
        calls.append(("replace", source.name))
        replace(source, target)

    monkeypatch.setattr(os, "fsync", flushed)
    monkeypatch.setattr(os, "replace", replaced)
    write_atomically(tmp_path / "new" / "folder" / "file", "content")
    names = [tmp_path.name, "new"]  # each holds the name of a new folder
    assert calls[:2] == [("fsync", name) for name in names]
    assert [what for what, _ in calls[2:]] == ["fsync", "replace", "fsync"]
    assert calls[2][1] == calls[3][1] != "file"
    assert calls[4] == ("fsync", "folder")


@pytest.mark.parametrize(("number", "raised"), [(errno.EINVAL, False), (errno.ENOTSUP, False), (errno.EIO, True)])
def test_a_file_system_without_flushed_folders_is_used_and_a_broken_one_is_told(tmp_path, monkeypatch, number, raised):
    fsync = os.fsync

    def flushed(descriptor: int) -> None:
        if stat.S_ISDIR(os.fstat(descriptor).st_mode):
            raise OSError(number, os.strerror(number))
        fsync(descriptor)

    monkeypatch.setattr(os, "fsync", flushed)
    with pytest.raises(OSError, match=os.strerror(number)) if raised else nullcontext():
        write_atomically(tmp_path / "file", "content")
    assert (tmp_path / "file").read_text() == "content"


def test_what_a_killed_process_left_is_swept_up(tmp_path: Path) -> None:
    with replacing(tmp_path / "file") as temporary:
        temporary.write_text("whole")
        left = temporary
    left.write_text("half")  # kill -9 before the rename
    for name in ("file", ".hidden", "other.tmp"):
        (tmp_path / name).write_text("kept")
    sweep_temporaries(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == [".hidden", "file", "other.tmp"]
