"""Power cuts: a run goes on to the same bits from what the disk holds after each flush, and what was said is done."""

import os
import shutil
import stat
from pathlib import Path
from typing import NamedTuple

import pytest
from command_line import PLACE, train
from run_folders import assert_same_weights, finished_weights, weights
from steps import forbid_training

pytestmark = pytest.mark.filterwarnings("default")
EVERY_STEP = "trainer.checkpoint_seconds=0"
FIRST = ["config.yaml", "field.ckpt", "labels.json", "labels.npy", "mesh.ply", "result.json"]


class Disk(NamedTuple):
    """What a disk holds if it forgets all that was not flushed.

    Attributes:
        files: Inode -> content when it was flushed last.
        folders: Inode -> its names when it was flushed last, each with the inode.
        names: The same for all folders, flushed or not: a disk may also have written the names and not the content.
    """

    files: dict[int, bytes]
    folders: dict[int, dict[str, int]]
    names: dict[int, dict[str, int]]


class Recorder:
    """Stands in for `os.fsync`, and keeps the disk's state after each call of it."""

    def __init__(self, root: Path) -> None:
        self.root, self.fsync = root, os.fsync
        self.files: dict[int, bytes] = {}
        self.folders: dict[int, dict[str, int]] = {}
        self.disks: list[Disk] = []

    def __call__(self, descriptor: int) -> None:
        self.fsync(descriptor)
        found, path = os.fstat(descriptor), Path(f"/proc/self/fd/{descriptor}").resolve()
        if stat.S_ISDIR(found.st_mode):
            self.folders[found.st_ino] = {entry.name: entry.inode() for entry in os.scandir(path)}
        else:
            self.files[found.st_ino] = path.read_bytes()
        names = {
            Path(top).stat().st_ino: {e.name: e.inode() for e in os.scandir(top)} for top, *_ in os.walk(self.root)
        }
        self.disks.append(Disk(dict(self.files), dict(self.folders), names))


def restore(disk: Disk, root: int, folder: Path, *, lost_names: bool) -> None:
    """Write what the disk holds below the folder of an inode; a file that was never flushed is there and empty."""
    folder.mkdir()
    for name, inode in (disk.folders if lost_names else disk.names).get(root, {}).items():
        if inode in disk.names:  # a folder
            restore(disk, inode, folder / name, lost_names=lost_names)
        else:
            (folder / name).write_bytes(disk.files.get(inode, b""))


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """The disk after each flush of a run that writes a checkpoint at every step, and the inode of its outputs."""
    outputs = tmp_path_factory.mktemp("recorded")
    recorder = Recorder(outputs)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", recorder)
        answer = train(outputs, EVERY_STEP)
    assert answer.code == 0, answer.text
    return recorder.disks, outputs.stat().st_ino


def points(count: int) -> list[int]:
    """Flushes of the recorded run: at most so many, spread over the run."""
    return sorted({round(share * 1000 / max(count - 1, 1)) for share in range(count)})


@pytest.mark.parametrize("lost_names", [True, False], ids=["names lost", "names kept"])
@pytest.mark.parametrize("share", points(int(os.environ.get("JOINTSDF_POWER_CUTS", "3"))))
def test_after_a_power_cut_the_run_goes_on_to_the_same_bits(tmp_path, recorded, share, lost_names):
    disks, root = recorded
    outputs = tmp_path / "outputs"
    restore(disks[share * (len(disks) - 1) // 1000], root, outputs, lost_names=lost_names)
    answer = train(outputs, EVERY_STEP)
    assert answer.code == 0, answer.text
    assert_same_weights(weights(outputs), finished_weights())
    assert not list(outputs.rglob("*.tmp"))


def test_a_run_that_said_it_is_done_is_whole(tmp_path, recorded, monkeypatch):
    disks, root = recorded
    outputs = tmp_path / "outputs"
    restore(disks[-1], root, outputs, lost_names=True)
    held = {path.name for path in (outputs / PLACE).iterdir() if path.stat().st_size}
    assert held >= set(FIRST), "what the row speaks of"
    forbid_training(monkeypatch)
    answer = train(outputs)
    assert answer.code == 0, answer.text
    assert "holds this run's result already" in answer.text
    assert_same_weights(weights(outputs), finished_weights())


def test_a_row_is_on_the_disk_after_all_that_it_speaks_of(tmp_path, recorded):
    disks, root = recorded
    seen = 0
    for number, disk in enumerate(disks):
        folder = tmp_path / str(number)
        restore(disk, root, folder, lost_names=True)
        run = folder / PLACE
        if (run / "result.json").is_file():
            seen += 1
            assert all((run / name).stat().st_size for name in FIRST), number
        shutil.rmtree(folder)
    assert seen
