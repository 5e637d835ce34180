"""One process at a time works on a run folder; its lock ends with it."""

import errno
import fcntl
import os
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from jointsdf.errors import InputError
from jointsdf.runs.lock import LOCK, Busy, is_locked, lock

HOLD = """
import sys
from pathlib import Path
from jointsdf.runs.lock import lock
with lock(Path(sys.argv[1]), wait=False):
    print("held", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def holder(tmp_path: Path) -> Iterator[subprocess.Popen]:
    """Another process that holds the folder's lock until its input is closed, or it is killed."""
    command = [sys.executable, "-c", HOLD, str(tmp_path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "held\n"
        yield process
        process.kill()


def test_a_lock_is_there_during_its_block_alone(tmp_path: Path) -> None:
    folder = tmp_path / "new" / "run"
    assert not is_locked(folder)
    with lock(folder, wait=False):
        assert is_locked(folder)
    assert not is_locked(folder)
    assert list(folder.iterdir()) == []
    with pytest.raises(RuntimeError), lock(folder, wait=False):
        raise RuntimeError
    assert list(folder.iterdir()) == []


def test_a_lock_keeps_other_processes_out(tmp_path: Path, holder: subprocess.Popen) -> None:
    assert is_locked(tmp_path)
    with pytest.raises(Busy, match=str(tmp_path)), lock(tmp_path, wait=False):
        raise AssertionError("two at once")
    assert holder.poll() is None
    assert is_locked(tmp_path)


def test_a_lock_dies_with_its_process(tmp_path: Path, holder: subprocess.Popen) -> None:
    holder.kill()
    holder.wait()
    assert (tmp_path / LOCK).exists(), "the file that a killed process leaves is no lock"
    assert not is_locked(tmp_path)
    with lock(tmp_path, wait=False):
        pass
    assert not (tmp_path / LOCK).exists()


def test_who_waits_goes_on_when_the_other_process_is_done(
    tmp_path: Path, holder: subprocess.Popen, caplog: pytest.LogCaptureFixture
) -> None:
    got_it = threading.Event()

    def work() -> None:
        with lock(tmp_path, wait=True):
            got_it.set()

    with caplog.at_level("INFO"):
        waiter = threading.Thread(target=work)
        waiter.start()
        assert not got_it.wait(0.3)
        assert holder.stdin is not None
        holder.stdin.close()
        assert got_it.wait(60)
        waiter.join()
    assert f"{tmp_path}: another process works on it; waiting for that one" in caplog.messages
    assert not (tmp_path / LOCK).exists()


def _bind(path: Path, _: Path) -> None:
    with socket.socket(socket.AF_UNIX) as made:
        made.bind(os.path.relpath(path))  # the name of a socket has at most 107 bytes


PLANTED: dict[str, Callable[[Path, Path], object]] = {
    "a link to a file": lambda path, precious: path.symlink_to(precious),
    "a link to nothing": lambda path, precious: path.symlink_to(precious.with_name("made")),
    "a link to itself": lambda path, _: path.symlink_to(path),
    "a link to a device": lambda path, _: path.symlink_to("/dev/null"),
    "a folder": lambda path, _: path.mkdir(),
    "a pipe": lambda path, _: os.mkfifo(path),
    "a socket": _bind,
}


@pytest.mark.parametrize("plant", PLANTED.values(), ids=PLANTED)
def test_what_is_planted_in_place_of_the_lock_is_refused_untouched(
    tmp_path: Path, plant: Callable[[Path, Path], object]
) -> None:
    folder, precious = tmp_path / "run", tmp_path / "precious"
    folder.mkdir()
    precious.write_text("content")
    plant(folder / LOCK, precious)
    assert not is_locked(folder)
    with pytest.raises(InputError) as refused, lock(folder, wait=True):
        raise AssertionError("locked")
    assert str(refused.value).startswith(f"{folder / LOCK}: ")
    assert precious.read_text() == "content"
    assert {entry.name for entry in tmp_path.iterdir()} == {"run", "precious"}
    assert os.path.lexists(folder / LOCK)


def test_a_second_name_of_a_file_loses_the_name_alone(tmp_path: Path) -> None:
    """A hard link, which no look at the file tells from a lock that a killed process left."""
    folder, precious = tmp_path / "run", tmp_path / "precious"
    folder.mkdir()
    precious.write_text("content")
    os.link(precious, folder / LOCK)
    with lock(folder, wait=False):
        assert precious.read_text() == "content"
    assert precious.read_text() == "content"
    assert list(folder.iterdir()) == []


@pytest.mark.parametrize("number", [errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP])
def test_a_file_system_without_locks_is_one_line(tmp_path: Path, number: int, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(fcntl, "flock", refuse)
    with (
        pytest.raises(InputError, match=r"its file system has no locks .*; give paths\.outputs=<a folder"),
        lock(tmp_path, wait=True),
    ):
        raise AssertionError("locked")
    assert not is_locked(tmp_path)
