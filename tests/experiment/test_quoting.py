"""Quoted overrides mean what the user typed; the oracle is Hydra's own parser, then OmegaConf."""

from pathlib import Path

import pytest
from hydra.core.override_parser.overrides_parser import OverridesParser
from omegaconf import OmegaConf
from strange_names import STRANGE

from jointsdf.errors import InputError
from jointsdf.experiment.quoting import quote_override


def meanings(override: str) -> list[object]:
    """The values of a run or of a sweep's runs, as a config gives them."""
    parsed = OverridesParser.create().parse_override(override)
    values = list(parsed.sweep_iterator()) if parsed.is_sweep_override() else [parsed.value()]
    if parsed.is_sweep_override():
        jobs = (f"key={text}" for text in parsed.sweep_string_iterator())
        values = [OverridesParser.create().parse_override(job).value() for job in jobs]
    return [OmegaConf.to_container(OmegaConf.create({"key": value}), resolve=True)["key"] for value in values]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("key", ["shape", "shapes", "labels", "partfield_dir", "run", "paths.outputs", "+shape"])
@pytest.mark.parametrize("kind", STRANGE)
def test_an_existing_file_is_meant_as_it_is_called(folder, kind, key) -> None:
    for name in (STRANGE[kind], f"{STRANGE[kind]}.stl", f"sub folder, 2/{STRANGE[kind]}"):
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).touch()
        assert meanings(quote_override(f"{key}={name}")) == [name]
        assert meanings(quote_override(f"{key}={folder / name}")) == [str(folder / name)]


@pytest.mark.parametrize("kind", STRANGE)
def test_existing_files_stay_whole_in_a_sweep(folder, kind) -> None:
    names = [f"{STRANGE[kind]}.stl", "a b.stl", STRANGE[kind], "c,d.stl"]
    for name in names:
        (folder / name).touch()
    found = quote_override(",".join(["shape=part_01", *names, "part_02"]), sweeps=True)
    assert meanings(found) == ["part_01", *names, "part_02"]


@pytest.mark.parametrize("sweeps", [False, True])
@pytest.mark.parametrize(
    "override",
    [
        "head=relu,siren",
        "seed=range(0,3)",
        "partfield_dir=null",
        "variant='a,b'",
        "shape=choice(part_01,part_02)",
        "shape=glob(part_*)",
        "shape='a,b.stl'",
        "shape='a,b.stl',\"c\"",
        "shape=a\\,b",
        "shape=part_01,part_02",
        "shape=${oc.env:HOME}/a.stl",
        "shapes=[a,'b c']",
        "shapes=my_parts/*.stl",
        "head.widths=[256,128]",
        "head.widths=[256",
        "seed=range(0,3",
        "loss.weights={eikonal:1}",
        "num_parts=null",
        "shape=",
        "~head",
        "~head=siren",
        "++data.cloud_size=3",
        "hydra/launcher=ray",
        "labels=a.ply:colour",
    ],
)
@pytest.mark.usefixtures("folder")
def test_what_hydra_reads_stays_as_it_is(override, sweeps) -> None:
    assert quote_override(override, sweeps=sweeps) == override


@pytest.mark.parametrize(
    ("override", "sweeps", "wanted"),
    [
        ("shape=no Gehäuse,v2.stl", False, ["no Gehäuse,v2.stl"]),
        ("shape=ä.stl,part_01", True, ["ä.stl", "part_01"]),
        ("study=Gehäuse (v2)", False, ["Gehäuse (v2)"]),
        ("variant=tap=3", False, ["tap=3"]),
        ("variant=a=1,b=2", True, ["a=1", "b=2"]),
        ("labels=parts, all.ply:my colour", False, ["parts, all.ply:my colour"]),
        ("paths.outputs=runs (new)", False, ["runs (new)"]),
        ("paths.outputs=runs,v2", False, ["runs,v2"]),
        ("paths.outputs=007", False, ["007"]),
        ("variant=1.0", False, ["1.0"]),
        ("variant=[a]", False, ["[a]"]),
        ("variant=a,b", False, ["a,b"]),
        ("variant=1.0,1e5", True, ["1.0", "1e5"]),
        ("study=null", True, ["null"]),
        ("head=rélu", False, ["rélu"]),
        ("shape=it's mine, new.stl,'b,c.stl'", True, ["it's mine, new.stl", "b,c.stl"]),
    ],
)
def test_what_the_grammar_refuses_is_quoted(folder, override, sweeps, wanted) -> None:
    for name in ("parts, all.ply", "it's mine, new.stl"):
        (folder / name).touch()
    assert meanings(quote_override(override, sweeps=sweeps)) == wanted


@pytest.mark.usefixtures("folder")
def test_an_interpolation_outside_of_names_of_files_is_one() -> None:
    found = quote_override("variant=tap=${trunk.tap}")
    value = OverridesParser.create().parse_override(found).value()
    assert OmegaConf.create({"variant": value, "trunk": {"tap": 4}}).variant == "tap=4"


def test_several_files_of_a_folder_sweep_are_a_list(folder) -> None:
    for name in ("a b", "c,d"):
        (folder / name).touch()
    assert meanings(quote_override("shapes=a b,c,d,e*.stl", sweeps=True)) == [["a b", "c,d", "e*.stl"]]


def test_the_home_folder_is_expanded_unless_a_file_has_that_name(folder, monkeypatch) -> None:
    monkeypatch.setenv("HOME", str(folder))
    (folder / "my part.stl").touch()
    assert meanings(quote_override("shape=~/my part.stl")) == [f"{folder}/my part.stl"]
    assert meanings(quote_override("paths.outputs=~/new (runs)")) == [f"{folder}/new (runs)"]
    (folder / "~").mkdir()
    (folder / "~" / "my part.stl").touch()
    assert meanings(quote_override("shape=~/my part.stl")) == ["~/my part.stl"]


@pytest.mark.parametrize("name", ["a\nb", "a\rb", "a\x1b[31mb", "a\udcffb", "a\u2028b"])
def test_a_name_that_no_line_can_hold_is_refused(name) -> None:
    with pytest.raises(InputError, match="rename the file") as caught:
        quote_override(f"shape={name}.stl")
    assert str(caught.value).isprintable()
