"""The fingerprint holds what decides a run's numbers, in the form that the committed rows were hashed with."""

import json
from copy import deepcopy
from pathlib import Path
from typing import Any

import pytest
import yaml

from jointsdf.runs.fingerprint import LATER_KEYS, METRICS, fingerprint_of
from jointsdf.runs.row import config_hash

ROOT = Path(__file__).parents[2]
HASH_OF_EVALUATION = "1f7ec7ce30df827d"  # a part of what the committed rows were hashed with
SETTINGS: dict[str, dict[str, Any]] = {  # of each metric in those hashes
    "chamfer": {},
    "normal_consistency": {"form": "cosine"},
    "f_score": {"threshold": 0.005},
    "segmentation": {},
    "consistency": {"neighbours": 10, "anchors": 1000, "seed": 0},
    "surface_distance": {},
    "exact_labels": {},
    "boundary": {"spacing": 0.001, "tolerance": 0.01},
    "topology": {},
}
CORRUPTION = {"density": 2.0, "missing": 0.1, "count": 90, "outliers": 0.1, "noise": 0.1, "label_flip": 0.1}


@pytest.fixture
def settings() -> dict[str, Any]:
    """A resolved config with every group and every later key."""
    evaluation = yaml.safe_load((ROOT / "conf/evaluation/default.yaml").read_text())
    evaluation = json.loads(json.dumps(evaluation))  # the protocols share their metrics in YAML
    return {
        "seed": 0,
        "study": "fast",
        "part_solids": "ply",
        "logger": {"name": "csv"},
        "tessellation": {"tolerance": 0.01},
        "data": {
            "cloud_size": 100,
            "region_points": 50,
            "crease_points": 60,
            "denoise": True,
            "part_points": 40,
            "workers": 4,
            "corruption": {**CORRUPTION, "scanner": {"views": 7, "noise": 0.1}},
            "counts": {"manifold": 10, "regions": 0.5, "creases": 0.25, "far": 3, "per_part": 24},
        },
        "trunk": {"width": 16, "far": "grid", "far_resolution": 48},
        "head": {"name": "siren"},
        "loss": {"weights": {"eikonal": 1.0}},
        "optimizer": {"lr": 1e-3, "iterations": "three"},
        "trainer": {"max_steps": 8, "refit": 25, "accelerator": "cpu", "preview_every": 5},
        "extraction": {"resolution": 64, "sharp": True, "smallest_piece": 0.003, "simplify": 1e-4},
        "evaluation": evaluation,
        "viewing": {"page": True},
    }


def test_machine_and_names_of_the_run_are_no_part_of_it(settings: dict[str, Any]) -> None:
    found = fingerprint_of(settings, name="part_01")
    assert found["trainer"] == {"max_steps": 8, "refit": 25}
    assert found["data"] == {
        "cloud_size": 100,
        "region_points": 50,
        "crease_points": 60,
        "denoise": True,
        "part_points": 40,
        "corruption": {**CORRUPTION, "scanner": {"views": 7, "noise": 0.1}},
        "counts": {"manifold": 10, "regions": 0.5, "creases": 0.25, "far": 3, "per_part": 24},
    }
    assert found["shape"] == {"name": "part_01"}
    assert not {"study", "part_solids", "logger", "viewing"} & found.keys()
    kept = ("seed", "tessellation", "trunk", "head", "loss", "optimizer", "extraction", "evaluation")
    for protocol in settings["evaluation"]["protocols"].values():
        protocol.pop("field", None)  # these came after the first committed rows
        for later in ("boundary_fine", "edges", "crease_normals", "crease_borders", "flatness", "specks"):
            protocol["metrics"].pop(later, None)
    assert {key: found[key] for key in kept} == {key: settings[key] for key in kept}


def placed(settings: dict[str, Any], key: str) -> tuple[dict[str, Any], str]:
    """The mapping in which a dotted key lies, and its last name."""
    *above, name = key.split(".")
    for group in above:
        settings = settings[group]
    return settings, name


@pytest.mark.parametrize("later", LATER_KEYS, ids=lambda later: later.key)
def test_a_later_key_at_its_neutral_value_gives_the_fingerprint_without_it(later, settings: dict[str, Any]) -> None:
    given = fingerprint_of(settings)
    before = deepcopy(settings)
    for key in (later.key, *later.moot):
        group, name = placed(before, key)
        assert name in placed(given, key)[0], "at another value it decides"
        del group[name]
    at_neutral = deepcopy(settings)
    group, name = placed(at_neutral, later.key)
    group[name] = later.neutral
    untouched = deepcopy(at_neutral)
    assert fingerprint_of(at_neutral) == fingerprint_of(before) != given
    assert at_neutral == untouched, "the config itself is left alone"
    for moot in later.moot:
        group, name = placed(at_neutral, moot)
        group[name] = "anything"
    assert fingerprint_of(at_neutral) == fingerprint_of(before)


def test_the_metrics_are_those_of_the_committed_rows(settings: dict[str, Any]) -> None:
    evaluation = fingerprint_of(settings)["evaluation"]
    assert config_hash(evaluation) == HASH_OF_EVALUATION
    assert set(METRICS) == SETTINGS.keys()
    for name, protocol in evaluation["protocols"].items():
        for metric in protocol["metrics"].values():
            del metric["_target_"]
        assert protocol["metrics"] == SETTINGS | ({"normal_consistency": {"form": "axes"}} if name == "flatcad" else {})


def test_a_further_metric_is_no_part_of_it(settings: dict[str, Any]) -> None:
    before = fingerprint_of(deepcopy(settings))
    settings["evaluation"]["protocols"]["unit"]["metrics"]["hausdorff"] = {"_target_": "mine.Hausdorff", "quantile": 1}
    untouched = deepcopy(settings)
    assert fingerprint_of(settings) == before
    assert settings == untouched


@pytest.mark.parametrize(
    ("key", "value"),
    [("unit.points", 99), ("flatcad.frame", "truth"), ("unit.metrics.f_score.threshold", 0.01), ("unit.metrics", {})],
)
def test_any_change_of_a_known_metric_or_of_its_protocol_is_part_of_it(settings, key: str, value: object) -> None:
    before = fingerprint_of(deepcopy(settings))
    group, name = placed(settings["evaluation"]["protocols"], key)
    group[name] = value
    assert fingerprint_of(settings) != before
