"""Words of a command line: bare names of files are the shape, and Hydra's options stay what they are."""

from pathlib import Path

import pytest
from strange_names import STRANGE

from jointsdf.errors import InputError
from jointsdf.experiment.arguments import evaluate_arguments, fit_arguments
from jointsdf.experiment.quoting import quote_path


@pytest.fixture
def folder(tmp_path: Path, monkeypatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    for name in ("a.stl", "b c.stl", "parts/d.stl", "-x.stl", "x/hidden_omega=1.0/e.stl", "home/f.stl", "job"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    return tmp_path


@pytest.mark.parametrize("kind", [kind for kind in STRANGE if kind != "spaces at its ends"])
def test_a_bare_file_is_the_shape(folder, kind) -> None:
    (folder / STRANGE[kind]).touch()
    assert fit_arguments([STRANGE[kind]]) == [f"shape={quote_path(STRANGE[kind])}"]


@pytest.mark.parametrize(
    ("words", "wanted"),
    [
        (["a.stl", "head=relu"], ["head=relu", "shape='a.stl'"]),
        (["-m", "a.stl", "head=relu,siren"], ["-m", "head=relu,siren", "shape='a.stl'"]),
        (["x/hidden_omega=1.0/e.stl"], ["shape='x/hidden_omega=1.0/e.stl'"]),
        (["-x.stl"], ["shape='-x.stl'"]),
        (["shape=-x.stl"], ["shape='-x.stl'"]),
        (["~/f.stl"], ["shape='{}/home/f.stl'"]),
        (["parts/"], ["shapes=['parts/']", "sweeps=folder"]),
        (["parts", "sweeps=main"], ["sweeps=main", "shapes=['parts']"]),
        (["a.stl", "b c.stl"], ["shapes=['a.stl','b c.stl']", "sweeps=folder"]),
        (["*.stl"], ["shapes=['*.stl']", "sweeps=folder"]),
        (["shapes=parts"], ["shapes='parts'", "sweeps=folder"]),
        (["--cfg", "job", "a.stl"], ["--cfg", "job", "shape='a.stl'"]),
        (["-c", "job", "--resolve"], ["-c", "job", "--resolve"]),
        (["--cfg=job"], ["--cfg=job"]),
        (["--info"], ["--info"]),
        (["-sc", "install=bash"], ["-sc", "install=bash"]),
        (["~head", "~sweeps=null"], ["~head", "~sweeps=null"]),
        (["sweeps=smoke", "study=ä,b"], ["sweeps=smoke", "study='ä',b"]),
    ],
)
def test_words(folder, words, wanted) -> None:
    assert fit_arguments(words) == [word.replace("{}", str(folder)) for word in wanted]


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["prat.stl"], "prat.stl: neither a file nor a folder"),
        (["part_01"], "shape=part_01"),
        (["a.stl", "shape=part_01"], "a.stl: the shape is given twice"),
        (["shape=a.stl", "shapes=parts"], "the shape is given twice"),
        (["a\nb.stl"], "line break"),
    ],
)
@pytest.mark.usefixtures("folder")
def test_a_word_that_is_neither_is_one_line(words, named) -> None:
    with pytest.raises(InputError, match=named) as caught:
        fit_arguments(words)
    assert "\n" not in str(caught.value)


@pytest.mark.usefixtures("folder")
def test_a_bare_folder_is_the_run_to_evaluate() -> None:
    assert evaluate_arguments(["x/hidden_omega=1.0"]) == ["run='x/hidden_omega=1.0'"]
    assert evaluate_arguments(["run=x/hidden_omega=1.0"]) == ["run='x/hidden_omega=1.0'"]
    with pytest.raises(InputError, match="one run at a time"):
        evaluate_arguments(["x", "parts"])
