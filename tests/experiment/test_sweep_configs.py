"""Stored sweeps make the runs that they name, in folders of their own, with the settings of the committed rows."""

import csv

import pytest
import yaml
from command_line import ROOT, call, train
from omegaconf import OmegaConf

from jointsdf.experiment import build, sweep
from jointsdf.experiment.settings import folder_of, shared_settings
from jointsdf.runs.plan import planned_runs
from jointsdf.runs.row import config_hash

pytestmark = pytest.mark.filterwarnings("default")
SWEEPS = sorted(path.stem for path in (ROOT / "sweeps").glob("*.yaml") if path.stem != "folder")
HEADS = ("none", "relu", "siren", "hybrid", "deep_skip")


def stored(name: str) -> dict:
    return yaml.safe_load((ROOT / "sweeps" / f"{name}.yaml").read_text())


def swept(name: str, key: str) -> list[str]:
    values = stored(name)["hydra"]["sweeper"]["params"][key]
    return [value.strip() for value in values.split(",")]


@pytest.fixture
def composed(monkeypatch) -> list:
    """The configs of the runs that a sweep makes; nothing is run."""
    configs: list = []
    monkeypatch.setattr(sweep, "run_one", lambda cfg: configs.append(cfg.copy()))
    return configs


def test_the_stored_sweeps_are_the_papers_and_the_ablations() -> None:
    assert {"main", "paired", "builtin", "smoke"} < set(SWEEPS)
    abc, parts = [f"abc_{n:04d}" for n in range(1, 51)], [f"part_{n:02d}" for n in range(1, 51)]
    assert (swept("main", "shape"), swept("main", "head")) == (abc, list(HEADS[1:]))
    assert (swept("paired", "shape"), swept("paired", "head")) == (abc, list(HEADS))
    assert (swept("builtin", "shape"), swept("builtin", "head")) == (parts, list(HEADS))
    assert (swept("points", "shape"), swept("points", "head")) == (abc, ["none", "hybrid"])
    assert (stored("patches")["labels"], swept("patches", "head")) == ("brep", ["siren", "hybrid"])
    assert len(set(swept("patches", "shape"))) == 36
    assert set(swept("patches", "shape")) < set(abc)
    assert set(swept("smoke", "shape")) < set(parts)
    assert len(swept("smoke", "shape")) * len(swept("smoke", "head")) >= 4


@pytest.mark.parametrize("name", SWEEPS)
def test_a_stored_sweep_makes_the_runs_that_it_says(tmp_path, composed, name) -> None:
    """Narrowed to one of its shapes by the command line."""
    shape = swept(name, "shape")[0]
    answer = call("train.py", f"sweeps={name}", f"shape={shape}", f"paths.outputs={tmp_path}", "paths.abc_root=/data")
    params = {key: values.count(",") + 1 for key, values in stored(name)["hydra"]["sweeper"]["params"].items()}
    del params["shape"]
    count = 1
    for values in params.values():
        count *= values
    assert answer.code == 1, "nothing was run"
    assert answer.lines[-1] == f"{count} runs: 0 done, 0 skipped, 0 failed, {count} missing"
    assert len(composed) == count
    assert {cfg.shape for cfg in composed} == {shape}
    assert {cfg.study for cfg in composed} == {name}
    assert {cfg.paths.abc_missing for cfg in composed} == {"error" if shape.startswith("abc") else "fallback"}
    recipes = {
        "smoke": {"smoke"},
        "points": {"points"},
        "distance": {"fast", "network"},
        "robustness": {"scan", "points"},
    }
    assert {cfg.recipe for cfg in composed} == recipes.get(name, {"fast"})
    for cfg in composed:
        build.check_config(cfg)
    wanted = [folder_of(cfg) for cfg in composed]
    assert planned_runs(tmp_path / name) == wanted
    assert len(set(wanted)) == count, "every run has a folder of its own"


@pytest.mark.parametrize("name", [name for name in SWEEPS if (ROOT / "results" / name / "runs.csv").is_file()])
def test_the_committed_rows_are_of_the_runs_that_the_sweep_makes(tmp_path, composed, name) -> None:
    """What decides their numbers, shape and seed apart, is the same, so that no clone makes them again."""
    with (ROOT / "results" / name / "runs.csv").open(newline="") as file:
        made = {(row["variant"], row["head"]): row["settings_hash"] for row in csv.DictReader(file)}
    shape = swept(name, "shape")[0]
    call("train.py", f"sweeps={name}", f"shape={shape}", f"paths.outputs={tmp_path}", "paths.abc_root=/data")
    wanted = {}
    for cfg in composed:
        build.check_config(cfg)
        settings = OmegaConf.to_container(cfg, resolve=True)
        wanted[cfg.variant, cfg.head.name] = config_hash(shared_settings(settings))
    shared = wanted.keys() & made.keys()
    assert shared
    assert {key: wanted[key] for key in shared} == {key: made[key] for key in shared}


def test_the_borders_of_the_recipe_are_one_side_of_the_comparison(tmp_path, composed) -> None:
    """So that `main` has that side already."""
    run = ("shape=part_02", "head=siren", f"paths.outputs={tmp_path}")
    call("train.py", "sweeps=boundaries", *run)
    call("train.py", "sweeps=main", "paths.abc_missing=fallback", *run)
    plain, balanced, default = ((cfg.data.counts.balanced, cfg.data.counts.borders) for cfg in composed)
    assert plain == (0.0, 0.0)
    assert balanced == default


def test_the_command_line_narrows_any_axis(tmp_path, composed) -> None:
    call("train.py", "sweeps=ablation_tap", "shape=part_02,part_03", "trunk.tap=2", f"paths.outputs={tmp_path}")
    assert [(cfg.shape, cfg.trunk.tap, cfg.variant) for cfg in composed] == [
        ("part_02", 2, "tap=2"),
        ("part_03", 2, "tap=2"),
    ]


@pytest.mark.usefixtures("composed")
def test_runs_that_share_a_folder_are_named(tmp_path) -> None:
    answer = train(tmp_path, "-m", "trunk.tap=2,3")
    assert "2 runs share 1 folders: name what differs in variant=, e.g. 'variant=tap=${trunk.tap}'" in answer.text
