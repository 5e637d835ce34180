"""Run folders of quick runs: their contents, rows and weights."""

import json
import shutil
from pathlib import Path

import torch
from command_line import PLACE, finished

OUTPUTS_LEVEL = len(PLACE.parts) - 1  # index of the outputs folder among the parents of a run folder


def contents(folder: Path) -> dict[Path, tuple[int, bytes]]:
    """Modification time and bytes of every file."""
    return {path: (path.stat().st_mtime_ns, path.read_bytes()) for path in folder.rglob("*") if path.is_file()}


def folders_with(name: str, outputs: Path) -> list[str]:
    """Folders that hold a file of this name."""
    return sorted(path.parent.relative_to(outputs).as_posix() for path in outputs.rglob(name))


def own_copy(outputs: Path) -> Path:
    """A finished run that a test may damage."""
    return Path(shutil.copytree(finished(), outputs / PLACE))


def row_of(folder: Path) -> dict:
    """The result row without its checksums, as rows of before: whoever edits and writes it makes one that is sound."""
    content = json.loads((folder / "result.json").read_text())
    return {name: value for name, value in content.items() if not name.endswith("sha256")}


def checkpoint(outputs: Path) -> dict:
    """The only checkpoint of a fit in progress."""
    (path,) = outputs.rglob("last.ckpt")
    return torch.load(path, weights_only=True)


def weights(outputs: Path) -> dict[str, torch.Tensor]:
    """State of the only fitted field."""
    (path,) = outputs.rglob("field.ckpt")
    return torch.load(path, weights_only=True)["state"]


def finished_weights() -> dict[str, torch.Tensor]:
    """State of the fitted field of `command_line.finished`."""
    return weights(finished().parents[OUTPUTS_LEVEL])


def assert_same_weights(one: dict[str, torch.Tensor], other: dict[str, torch.Tensor]) -> None:
    """Bit by bit."""
    assert one.keys() == other.keys()
    for name in one:
        assert torch.equal(one[name], other[name]), name
