"""Folders that cannot be written and full disks are one line, and leave no result."""

import errno
import os
import shutil
import subprocess
from pathlib import Path

import pytest
from command_line import assert_one_line_error, train

from jointsdf.runs import files

pytestmark = pytest.mark.filterwarnings("default")


def test_outputs_that_are_a_file_are_one_line(tmp_path):
    (tmp_path / "out").write_text("mine")
    assert_one_line_error(train(tmp_path / "out"), str(tmp_path / "out"), "paths.outputs=")
    assert (tmp_path / "out").read_text() == "mine"


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_that_cannot_be_written_is_one_line(tmp_path):
    (tmp_path / "out").mkdir(mode=0o500)
    assert_one_line_error(train(tmp_path / "out"), str(tmp_path / "out"), "paths.outputs=")


def no_space(*_):
    raise OSError(errno.ENOSPC, "No space left on device")


@pytest.mark.parametrize(
    ("module", "name"), [(files.os, "replace"), (files.os, "fsync"), (Path, "write_bytes")], ids=str
)
def test_a_full_disk_is_one_line_and_leaves_no_result(tmp_path, monkeypatch, module, name):
    with monkeypatch.context() as patch:
        patch.setattr(module, name, no_space)
        answer = train(tmp_path)
    assert_one_line_error(answer, "No space left on device", "the disk is full", "paths.outputs=")
    assert not list(tmp_path.rglob("result.json"))
    assert not list(tmp_path.rglob("*.tmp"))
    assert train(tmp_path).code == 0, "with space again, the same command goes on"


@pytest.fixture(params=["64k", "1m"], ids=["less than the log", "less than a checkpoint"])
def small_disk(tmp_path, request):
    """A file system that is too small for a run."""
    disk = tmp_path / "disk"
    disk.mkdir()
    mount = shutil.which("mount")
    if (
        mount is None
        or subprocess.run([mount, "-t", "tmpfs", "-o", f"size={request.param}", "tmpfs", disk], check=False).returncode
    ):
        pytest.skip("no right to mount a small file system here")
    yield disk
    subprocess.run(["umount", "-l", disk], check=True)


def test_a_disk_that_is_really_full_is_one_line(small_disk):
    assert_one_line_error(train(small_disk), "the disk is full")
    assert not list(small_disk.rglob("result.json"))
    assert not list(small_disk.rglob("*.part"))
