"""Names of files and folders as people have them, through the real command line; fits and measures are left out."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner
from command_line import assert_one_line_error, call
from strange_names import STRANGE

from jointsdf import cli
from jointsdf.errors import InputError
from jointsdf.experiment import run
from jointsdf.shapes.naming import name_of_file
from jointsdf.values import Shape

pytestmark = pytest.mark.filterwarnings("default")
KINDS = [
    *("space", "single quote", "double quotes", "decomposed", "Chinese", "emoji", "comma", "equals", "parentheses"),
    *("brackets", "braces", "hash", "semicolon", "exclamation", "tilde", "angle", "ampersand", "interpolation"),
    *("backslashes before quotes", "leading dash", "number", "null", "200 characters"),
]
BOX = trimesh.creation.box((2, 3, 4))
Loaded = list[tuple[Shape, Path]]


@pytest.fixture
def loaded(monkeypatch, tmp_path) -> Loaded:
    """Ground truth and run folder of every run that is begun."""
    found: Loaded = []

    def note(_cfg, shape, folder, *_, **__):
        found.append((shape, folder))
        raise InputError("no fit")

    monkeypatch.setattr(run, "fit_shape", note)
    monkeypatch.chdir(tmp_path)
    return found


@pytest.mark.parametrize("kind", KINDS)
def test_a_run_takes_them_for_shape_labels_and_outputs(loaded, kind) -> None:
    name = STRANGE[kind]
    BOX.export(f"{name}.stl")
    np.save(f"{name}.npy", np.arange(12) // 4)
    if "${" in name:  # which names no new folder, but another value of the config
        Path(name).mkdir()
    answer = call("train.py", f"shape={name}.stl", f"labels={name}.npy", f"paths.outputs={name}")
    assert answer.lines[-1] == "error: no fit", answer.text
    ((shape, folder),) = loaded
    assert (shape.label_provider, len(shape.mesh.part_ids)) == (f"file:{name}.npy", 3)
    assert shape.name == name_of_file(Path(f"{name}.stl"), shape.mesh_sha256)
    assert folder == Path(name) / "fast/base/siren" / shape.name / "seed0"


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.usefixtures("loaded")
def test_evaluate_takes_them(kind) -> None:
    name = STRANGE[kind]
    Path(name).mkdir()
    assert call("evaluate.py", f"run={name}").lines[-1].startswith(f"error: {name}: not a run folder")


def test_the_console_command_passes_words_on(loaded) -> None:
    BOX.export("-x, y.stl")
    CliRunner().invoke(cli.main, ["fit", "-x, y.stl", "head=none"])
    ((shape, _),) = loaded
    assert shape.name.startswith("-x__y-")


@pytest.mark.usefixtures("loaded")
def test_a_missing_file_is_named_as_it_was_typed() -> None:
    for name in ("Geh\u00e4use (2).stl", "no & such.stl", "a=b.stl"):
        assert_one_line_error(call("train.py", f"shape={name}"), f"file not found: {name}")
        assert_one_line_error(call("evaluate.py", f"run={name}"), f"{name}: not a run folder")
