"""The command line, in this process and as a user types it."""

import logging
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest
from abc_files import ABC, FILES, NAME, NEEDS_RAW, OBJ, RAW, YML, assert_box_is_prepared, filled, seven_zip
from web_server import Server

from jointsdf.abc_dataset import archive, chunks, command, convert, download, prepare


def urls(tmp_path: Path, *served: chunks.Chunk) -> Path:
    table = tmp_path / "urls.csv"
    rows = [f"{each.kind},{each.chunk},{each.url},{each.md5},{each.bytes}" for each in served]
    table.write_text("\n".join([",".join(chunks.COLUMNS), *rows]))
    return table


@pytest.fixture
def run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> Callable[..., SimpleNamespace]:
    """The command in this process, on the shapes of one folder."""
    monkeypatch.setattr(download.time, "sleep", lambda _: None)
    caplog.set_level(logging.INFO)

    def call(*arguments: object, shape: str = NAME) -> SimpleNamespace:
        caplog.clear()
        words = ["prepare", "--root", str(tmp_path / "root"), "--shapes", shape, *map(str, arguments)]
        code = command.main(words)
        errors = [each.getMessage() for each in caplog.records if each.levelno == logging.ERROR]
        return SimpleNamespace(code=code, errors=errors, text=caplog.text)

    return call


def test_sizes_that_are_promised_are_those_of_the_table() -> None:
    sizes = {
        kind: sum(each.bytes for each in chunks.select_chunks(chunks.read_table(), [kind], [chunks.MAIN]))
        for kind in chunks.KINDS
    }
    assert command.format_size(sizes["step"]) == "1.6 GB"
    assert command.format_size(sizes["obj"] + sizes["feat"]) == "12.5 GB"


def test_from_two_archives_on_the_web_and_then_nothing_twice(
    server: Server, tmp_path: Path, run: Callable[..., SimpleNamespace], monkeypatch: pytest.MonkeyPatch
) -> None:
    served = [
        server.chunk(kind, seven_zip(tmp_path / f"{kind}.7z", {f"00000007/{name}": FILES[name]}))
        for kind, name in (("obj", OBJ), ("feat", YML))
    ]
    arguments = ("--format", "obj", "--urls", urls(tmp_path, *served), "--yes")
    assert run(*arguments).code == 0
    assert_box_is_prepared(tmp_path / "root")
    assert len(server.ranges) == 2
    before = (tmp_path / "root" / NAME / "mesh.ply").stat().st_mtime_ns
    monkeypatch.setattr(archive, "extract", None)
    monkeypatch.setattr(convert, "write_shape", None)
    again = run(*arguments)
    assert (again.code, len(server.ranges)) == (0, 2)
    assert "already there" in again.text
    assert (tmp_path / "root" / NAME / "mesh.ply").stat().st_mtime_ns == before


def test_an_interrupted_run_goes_on(
    server: Server, tmp_path: Path, run: Callable[..., SimpleNamespace], monkeypatch: pytest.MonkeyPatch
) -> None:
    served = [server.chunk(k, seven_zip(tmp_path / f"{k}.7z", FILES)) for k in ("obj", "feat")]
    arguments = ("--format", "obj", "--urls", urls(tmp_path, *served), "--yes")
    begun: list[str] = []
    open_file = Path.open

    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    def opened(path: Path, mode: str = "r", *more: object, **named: object) -> object:
        if mode == "wb" and path.suffix == ".part" and path.stem in FILES:
            begun.append(path.stem)
            if len(begun) == 2:
                interrupted()
        return open_file(path, mode, *more, **named)

    monkeypatch.setattr(Path, "open", opened)
    stopped = run(*arguments)
    assert (stopped.code, begun) == (130, [OBJ, YML])
    assert "goes on from here" in stopped.text
    with monkeypatch.context() as patched:
        patched.setattr(convert, "write_atomically", interrupted)
        assert run(*arguments).code == 130
    assert begun == [OBJ, YML, YML]
    assert not prepare.is_prepared(NAME, tmp_path / "root")
    assert run(*arguments).code == 0
    assert (begun, len(server.ranges)) == ([OBJ, YML, YML], 2)
    assert_box_is_prepared(tmp_path / "root")
    assert not list((tmp_path / "root").rglob("*.part"))


def test_local_archives_need_no_web(tmp_path: Path, run: Callable[..., SimpleNamespace]) -> None:
    filled(tmp_path / "in", {})
    seven_zip(tmp_path / "in" / "abc_0000_obj_v00.7z", {OBJ: FILES[OBJ]})
    seven_zip(tmp_path / "in" / "abc_0000_feat_v00.7z", {YML: FILES[YML]})
    (tmp_path / "in" / "abc_0001_obj_v00.7z").write_bytes(b"of another chunk: not opened")
    (tmp_path / "in" / "abc_0000_meta_v00.7z").write_bytes(b"of no use: not opened")
    assert run("--from", tmp_path / "in").code == 0
    assert_box_is_prepared(tmp_path / "root")


@NEEDS_RAW
def test_an_archive_of_any_name_can_be_named(tmp_path: Path, run: Callable[..., SimpleNamespace]) -> None:
    stem = "00000655_d87d11d9c3ca4ee5a88797ae"
    real = {f"00000655/{path.name}": path.read_bytes() for path in RAW.glob(f"{stem}_*")}
    assert run("--from", seven_zip(tmp_path / "mine.7z", real), shape="abc_0015").code == 0
    assert (tmp_path / "root/abc_0015/mesh.ply").read_bytes() == (ABC / "abc_0015/mesh.ply").read_bytes()


def test_a_damaged_local_archive_is_one_line(tmp_path: Path, run: Callable[..., SimpleNamespace]) -> None:
    (tmp_path / "abc_0000_obj_v00.7z").write_bytes(b"")
    failed = run("--from", tmp_path)
    assert failed.code == 2
    assert len(failed.errors) == 1
    assert "abc_0000_obj_v00.7z is empty" in failed.errors[0]


def test_nothing_found_and_wrong_arguments_are_one_line(tmp_path: Path, run: Callable[..., SimpleNamespace]) -> None:
    (tmp_path / "x.zip").write_bytes(b"")
    cases = [
        (("--from", tmp_path / "nowhere"), "does not exist"),
        (("--from", tmp_path / "x.zip"), "neither a folder nor a 7z"),
        (("--from", filled(tmp_path / "hollow", {})), "no shape could be prepared"),
        (("--urls", tmp_path / "nowhere"), "cannot be read"),
        (("--shapes", "abc_0099"), "unknown shape 'abc_0099'"),
    ]
    for arguments, said in cases:
        failed = run(*arguments)
        assert (failed.code, len(failed.errors)) == (2, 1)
        assert said in failed.errors[0]


def test_the_download_is_shown_and_confirmed(
    server: Server, tmp_path: Path, run: Callable[..., SimpleNamespace], monkeypatch: pytest.MonkeyPatch
) -> None:
    served = server.chunk("step", seven_zip(tmp_path / "step.7z", {"a.txt": b"x"}))
    arguments = ("--urls", urls(tmp_path, served))
    answers: list[str] = []
    monkeypatch.setattr("builtins.input", lambda _: answers.pop())
    monkeypatch.setattr(sys, "stdin", SimpleNamespace(isatty=lambda: False))
    refused = run(*arguments)
    assert refused.code == 2
    assert "add --yes" in refused.errors[0]
    monkeypatch.setattr(sys, "stdin", SimpleNamespace(isatty=lambda: True))
    answers.append("")
    refused = run(*arguments)
    assert (refused.code, len(refused.errors)) == (2, 1)
    assert "abc_0000_step_v00.7z" in refused.text
    assert f"To download: {served.bytes} bytes" in refused.text
    assert server.ranges == []
    answers.append("y")
    assert run(*arguments).code == 2  # the archive has nothing of use
    assert server.ranges == [None]


def test_a_chunk_for_one_shape_is_not_loaded_unasked(
    server: Server, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    served = server.chunk("step", seven_zip(tmp_path / "step.7z", {"a.txt": b"x"}))
    words = ["prepare", "--root", str(tmp_path / "root"), "--urls", str(urls(tmp_path, served)), "--yes"]
    assert command.main(words) == 2
    assert "abc_0050 alone needs chunk 0001: --shapes abc_0050 gets it" in caplog.text
    assert command.main([*words, "--shapes", "abc_0050"]) == 2
    assert "no address of abc_0001_step_v00.7z is known" in caplog.text


def test_the_command_itself(tmp_path: Path) -> None:
    words = [sys.executable, "-m", "jointsdf.shapes.abc", "prepare", "--root", str(tmp_path / "root")]
    done = subprocess.run(words, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stdout == ""
    last = done.stderr.splitlines()[-1]
    assert last == "error: a download of 1.6 GB is to be confirmed, and this is no terminal: add --yes"
    assert not re.search("Traceback|Warning", done.stderr)
    assert not (tmp_path / "root").exists()
