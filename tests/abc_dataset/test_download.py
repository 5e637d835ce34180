"""Downloads that break, resume, and are checked."""

import errno
import io
import shutil
from pathlib import Path
from types import SimpleNamespace

import pytest
from web_server import Server

from jointsdf.abc_dataset import chunks, download
from jointsdf.errors import InputError


def fetch(chunk: chunks.Chunk, folder: Path) -> Path:
    return download.fetch(chunk, folder, pause=0.0, timeout=5.0)


def test_a_download_that_is_cut_goes_on_where_it_stopped(server: Server, chunk: chunks.Chunk, tmp_path: Path) -> None:
    server.cuts = [chunk.bytes // 2, 1000]
    assert fetch(chunk, tmp_path / "in").read_bytes() == server.files["/feat"]
    assert server.ranges == [None, f"bytes={chunk.bytes // 2}-", f"bytes={chunk.bytes // 2 + 1000}-"]
    assert [each.name for each in (tmp_path / "in").iterdir()] == [chunk.name]
    fetch(chunk, tmp_path / "in")
    assert len(server.ranges) == 3


def test_a_download_that_keeps_breaking_is_kept_for_the_next_run(
    server: Server, chunk: chunks.Chunk, tmp_path: Path
) -> None:
    server.cuts = [1000, 1000, 1000]
    with pytest.raises(InputError, match=f"3000 of {chunk.bytes} bytes are here after 3 tries") as refused:
        fetch(chunk, tmp_path)
    assert "\n" not in str(refused.value)
    assert download.part_path(chunk, tmp_path).read_bytes() == server.files["/feat"][:3000]
    assert fetch(chunk, tmp_path).read_bytes() == server.files["/feat"]
    assert server.ranges == [None, "bytes=1000-", "bytes=2000-", "bytes=3000-"]


def test_a_server_that_knows_no_ranges_sends_all_again(server: Server, chunk: chunks.Chunk, tmp_path: Path) -> None:
    server.cuts, server.knows_ranges = [chunk.bytes // 2], False
    assert fetch(chunk, tmp_path / "in").read_bytes() == server.files["/feat"]


def test_a_wrong_md5_deletes_the_download_and_names_both(chunk: chunks.Chunk, tmp_path: Path) -> None:
    wrong = chunks.Chunk(chunk.kind, chunk.chunk, chunk.url, "0" * 32, chunk.bytes)
    with pytest.raises(InputError, match=f"{chunk.md5}.*{'0' * 32}"):
        fetch(wrong, tmp_path / "in")
    assert list((tmp_path / "in").iterdir()) == []


def test_a_part_of_something_else_is_found_out(server: Server, chunk: chunks.Chunk, tmp_path: Path) -> None:
    download.part_path(chunk, tmp_path).write_bytes(b"x" * 5000)
    with pytest.raises(InputError, match="md5"):
        fetch(chunk, tmp_path)
    assert fetch(chunk, tmp_path).read_bytes() == server.files["/feat"]
    assert server.ranges == ["bytes=5000-", None]


def test_an_address_without_the_file_is_not_tried_again(server: Server, chunk: chunks.Chunk, tmp_path: Path) -> None:
    server.files.clear()
    with pytest.raises(InputError, match=r"answers 404.*--urls"):
        fetch(chunk, tmp_path)
    assert server.ranges == [None]


def test_a_busy_server_is_tried_again(server: Server, chunk: chunks.Chunk, tmp_path: Path) -> None:
    server.codes = [503, 429]
    assert fetch(chunk, tmp_path / "in").read_bytes() == server.files["/feat"]


def test_a_page_in_the_archives_place_is_refused_before_it_is_written(
    server: Server, chunk: chunks.Chunk, tmp_path: Path
) -> None:
    server.files["/feat"] = b"<html>We have moved</html>"
    with pytest.raises(InputError, match=f"26 bytes.*{chunk.bytes}"):
        fetch(chunk, tmp_path / "in")
    assert list((tmp_path / "in").iterdir()) == []


def test_nobody_there(chunk: chunks.Chunk, tmp_path: Path) -> None:
    gone = chunks.Chunk(chunk.kind, chunk.chunk, "http://127.0.0.1:1/x", chunk.md5, chunk.bytes)
    with pytest.raises(InputError, match=r"refused.*after 3 tries"):
        fetch(gone, tmp_path)


def test_a_full_disk_keeps_what_has_come(
    server: Server, chunk: chunks.Chunk, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class FullDisk(io.FileIO):
        def write(self, block: bytes) -> int:
            super().write(block[:2000])
            raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(Path, "open", lambda path, mode: FullDisk(path, mode))
        with pytest.raises(InputError, match="the disk is full"):
            fetch(chunk, tmp_path)
    assert server.ranges == [None]
    assert fetch(chunk, tmp_path).read_bytes() == server.files["/feat"]
    assert server.ranges == [None, "bytes=2000-"]


def test_what_cannot_fit_is_not_begun(
    server: Server, chunk: chunks.Chunk, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(free=chunk.bytes - 1))
    with pytest.raises(InputError, match="--root"):
        fetch(chunk, tmp_path)
    assert server.ranges == []
