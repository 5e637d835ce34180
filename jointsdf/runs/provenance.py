"""Provenance of a row: code, configuration, library versions, machine and date. Imports no torch."""

import hashlib
import os
import platform
import subprocess
from datetime import UTC, datetime
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import NamedTuple

from jointsdf.runs.row import Fact

LIBRARIES = ("torch", "lightning", "numpy", "scipy", "trimesh", "libigl", "scikit-image")
UNKNOWN = "unknown"
PACKAGE = Path(__file__).parents[1]


class CodeState(NamedTuple):
    """Version of the code that runs.

    Attributes:
        commit: Of the checkout; `unknown` where git does not track the code.
        dirty: Whether it was changed since the commit; `unknown` likewise.
        sha256: Of all Python files of the package.
    """

    commit: str
    dirty: bool | str
    sha256: str


def provenance(code: CodeState, *, config_hash: str, **facts: Fact) -> dict[str, Fact]:
    """Provenance entry of a row: code, configuration, library versions, machine and date (UTC).

    Args:
        code: From `code_state`, at the start of the run.
        config_hash: From `row.config_hash`.
        **facts: Entries of the run itself: device, mesh_sha256, label_provider, ...
    """
    return {
        "commit": code.commit,
        "dirty": code.dirty,
        "config_hash": config_hash,
        "python": platform.python_version(),
        "versions": {name: _version(name) for name in LIBRARIES},
        "machine": f"{platform.system()} {platform.machine()}, {cpu_model()}, {os.cpu_count()} cores",
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        **facts,
    }


@cache
def code_state(folder: Path = PACKAGE) -> CodeState:
    """Commit, changes and hash of the code in `folder`, read once per process.

    Call it at the start of a run: the loaded code runs on, even if the branch moves.
    """
    content = hashlib.sha256(b"".join(path.read_bytes() for path in sorted(folder.rglob("*.py")))).hexdigest()

    def git(*arguments: str) -> str:
        done = subprocess.run(
            ["git", "-C", str(folder), *arguments], capture_output=True, text=True, timeout=20, check=True
        )
        return done.stdout.strip()

    try:
        git("ls-files", "--error-unmatch", "values.py")  # an installed copy inside someone's repository is not it
        return CodeState(git("rev-parse", "HEAD"), bool(git("status", "--porcelain", "--", ".", "../conf")), content)
    except (OSError, subprocess.SubprocessError):
        return CodeState(UNKNOWN, UNKNOWN, content)


def _version(distribution: str) -> str:
    try:
        return metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return UNKNOWN


def cpu_model() -> str:
    """Name of the processor, from the system."""
    return _cpu_fact("model name") or platform.processor() or UNKNOWN


def cpu_vendor() -> str:
    """Vendor of the processor, from the system."""
    return _cpu_fact("vendor_id") or platform.machine()


def _cpu_fact(name: str) -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        lines = []
    return next((line.partition(":")[2].strip() for line in lines if line.startswith(name)), "")
