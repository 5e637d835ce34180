"""The CAD kernel in its process: crashes and limits."""

import resource
import sys
from pathlib import Path

import pytest
from mesh_files import put
from step_files import NEEDS_READER, ONE, step_boxes

from jointsdf.errors import InputError
from jointsdf.shapes.readers.step_process import Limits, run_worker

BOX = step_boxes(ONE).encode()


def stand_in(folder: Path, script: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Put a shell script in the place of the worker."""
    program = put(folder, "stand-in", f"#!/bin/sh\ncat > /dev/null\n{script}\n")
    program.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(program))


@pytest.mark.parametrize(
    ("script", "message"),
    [
        ("kill -SEGV $$", r"a.step is damaged: the STEP reader crashed on it \(signal 11\); export it again"),
        ("echo; echo bad; exit 3", "a.step cannot be tessellated: exit code 3; export it again"),
        ("echo why >&2; exit 3", "a.step cannot be tessellated: why; export it again"),
        ("exec sleep 60", "a.step takes the CAD kernel more than 1 s: it is damaged or too large; export it again"),
        ("echo MemoryError >&2; exit 1", "a.step takes the CAD kernel more than 0.5 GiB: it is damaged or too large"),
        ("exit 0", "a.step is damaged or holds no surface"),
    ],
)
def test_what_the_kernel_does_not_survive_is_one_line(
    script: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stand_in(tmp_path, script, monkeypatch)
    with pytest.raises(InputError, match=f"^{message}[^\n]*$"):
        run_worker(Path("a.step"), BOX, 1e-4, 0.1, Limits(seconds=0.5, memory=2**29))


def test_seconds_grow_with_the_file_up_to_a_limit() -> None:
    assert [Limits().seconds_for(size) for size in (0, 1_000_000, 10**9)] == [60, 120, 600]


def test_memory_is_no_more_than_this_process_has(monkeypatch: pytest.MonkeyPatch) -> None:
    granted = {resource.RLIMIT_AS: (resource.RLIM_INFINITY, 3 << 30)}
    monkeypatch.setattr(resource, "getrlimit", granted.__getitem__)
    assert [Limits(memory=memory << 30).bytes_here() >> 30 for memory in (1, 8)] == [1, 3]


@NEEDS_READER
def test_the_memory_limit_holds() -> None:
    with pytest.raises(InputError, match=r"^a.step (takes|cannot|is damaged)[^\n]*$"):
        run_worker(Path("a.step"), BOX, 1e-4, 0.1, Limits(memory=100 << 20))
