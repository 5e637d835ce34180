"""What a row says of its origin."""

import json
import os
import re
import subprocess
from pathlib import Path

import numpy as np
import pytest

from jointsdf.runs.provenance import LIBRARIES, CodeState, code_state, provenance

CODE = CodeState("123abc", False, "0" * 64)


def test_provenance_names_code_versions_and_machine() -> None:
    facts = provenance(CODE, config_hash="0123456789abcdef", device="cpu", label_provider="brep")
    assert (facts["commit"], facts["dirty"]) == ("123abc", False)
    assert facts["config_hash"] == "0123456789abcdef"
    assert (facts["device"], facts["label_provider"]) == ("cpu", "brep")
    versions = facts["versions"]
    assert isinstance(versions, dict)
    assert set(versions) == set(LIBRARIES)
    assert versions["numpy"] == np.__version__
    assert f"{os.cpu_count()} cores" in str(facts["machine"])
    assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\+00:00", str(facts["date"]))
    assert json.loads(json.dumps(facts)) == facts


def git(folder: Path, *arguments: str) -> str:
    identity = ["-c", "user.name=t", "-c", "user.email=t@example.org"]
    command = ["git", "-C", str(folder), *identity, *arguments]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()


def state_of(package: Path) -> tuple[str, bool | str]:
    """Commit and changes, read anew."""
    code_state.cache_clear()
    commit, dirty, _ = code_state(package)
    return commit, dirty


def test_the_commit_is_of_tracked_code_and_says_when_code_changed(tmp_path: Path) -> None:
    package = tmp_path / "package"
    package.mkdir()
    (tmp_path / "conf").mkdir()
    (package / "values.py").write_text("")
    assert state_of(package) == ("unknown", "unknown")  # no repository
    git(tmp_path, "init", "-q")
    git(tmp_path, "commit", "-q", "--allow-empty", "-m", "first")
    assert state_of(package) == ("unknown", "unknown")  # somebody else's repository
    git(tmp_path, "add", "package")
    git(tmp_path, "commit", "-q", "-m", "second")
    head = git(tmp_path, "rev-parse", "HEAD")
    assert state_of(package) == (head, False)
    (tmp_path / "notes.txt").write_text("not code")
    assert state_of(package) == (head, False)
    (tmp_path / "conf" / "new.yaml").write_text("a: 1")
    assert state_of(package) == (head, True)


def test_git_may_be_absent(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    code_state.cache_clear()
    assert code_state()[:2] == ("unknown", "unknown")
    code_state.cache_clear()


def test_the_commit_is_that_of_the_start(monkeypatch: pytest.MonkeyPatch) -> None:
    """A branch that moves while a process runs does not change what that process runs."""
    code_state.cache_clear()
    before = code_state()
    monkeypatch.setenv("PATH", "")
    assert code_state() == before


def test_the_hash_is_of_the_content_of_every_python_file(tmp_path: Path) -> None:
    found = []
    for content in ("a = 1", "a = 2", "a = 1"):
        (tmp_path / "values.py").write_text(content)
        code_state.cache_clear()
        found.append(code_state(tmp_path).sha256)
    assert found[0] == found[2] != found[1]
    (tmp_path / "notes.txt").write_text("not code")
    code_state.cache_clear()
    assert code_state(tmp_path).sha256 == found[0]
    code_state.cache_clear()
