"""Downloads from a web server on this machine, and the command in this process."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from abc_files import FILES, seven_zip
from web_server import Server

from jointsdf.abc_dataset import chunks


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch) -> Iterator[Server]:
    monkeypatch.setenv("no_proxy", "*")
    running = Server()
    yield running
    running.close()


@pytest.fixture
def chunk(server: Server, tmp_path: Path) -> chunks.Chunk:
    """A chunk of features, large enough to be cut."""
    noise = np.random.default_rng(0).bytes(300_000)
    return server.chunk("feat", seven_zip(tmp_path / "served.7z", {**FILES, "noise": noise}))
