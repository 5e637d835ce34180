"""Checksums (SHA-256) of a result row and of the files beside it, stored in `result.json`. Imports no torch.

They find damage and edits by mistake. They are no signature: whoever changes a row on purpose can seal it again.
"""

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from jointsdf.runs.stored_json import read_json

FILES = ("field.ckpt", "mesh.ply", "labels.npy")  # of a run folder, that its row speaks of
SEALS = FILES_KEY, ROW_KEY = "files_sha256", "sha256"


def seal(content: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Add the checksums of the files in the run folder to a row's content, and that of all this.

    Args:
        content: Of the row, JSON's types alone.
        folder: The run folder.
    """
    hashes = {name: _hash_file(folder / name) for name in FILES if (folder / name).is_file()}
    sealed = {**content, FILES_KEY: hashes}
    return {**sealed, ROW_KEY: canonical_hash(sealed)}


def unseal(content: Any) -> Any:
    """The content of a row without its checksums."""
    return {k: v for k, v in content.items() if k not in SEALS} if isinstance(content, Mapping) else content


def require_sealed(content: Mapping[str, Any]) -> None:
    """Compare the checksum of a row's content, where it has one: rows of before have none.

    Raises:
        ValueError: The content is not what was sealed.
    """
    bare = {name: value for name, value in content.items() if name != ROW_KEY}
    if ROW_KEY in content and content[ROW_KEY] != canonical_hash(bare):
        raise ValueError("it was changed after it was written: its checksum is that of other content")


def changed_files(row: Path) -> list[str]:
    """Names of the files beside a row that are not those of its run any more; deleted ones do not count.

    Args:
        row: Path of a `result.json`; rows of before have no checksums.

    Raises:
        ValueError: The row cannot be read. One line, without the path.
    """
    hashes = read_json(row).get(FILES_KEY, {})
    named = {name: hashes.get(name) for name in FILES if isinstance(hashes, Mapping) and name in hashes}
    there = {name: value for name, value in named.items() if (row.parent / name).is_file()}
    return [name for name, value in there.items() if value != _hash_file(row.parent / name)]


def canonical_hash(content: Any) -> str:
    """SHA-256 of canonical JSON.

    Args:
        content: JSON's types alone, finite.
    """
    canonical = json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(canonical.encode()).hexdigest()


def _hash_file(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
