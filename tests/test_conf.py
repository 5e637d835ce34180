"""Every yaml composes, every `_target_` takes its keys, and the values that the method fixes are what a run gets."""

import inspect
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from hydra import compose, initialize_config_dir
from hydra.errors import ConfigCompositionException
from hydra.utils import get_object
from omegaconf import DictConfig, OmegaConf

from jointsdf.data.datamodule import ShapeDataModule
from jointsdf.data.sample_settings import SampleSettings
from jointsdf.data.sampler import Counts
from jointsdf.experiment import build
from jointsdf.experiment.settings import resolve_settings
from jointsdf.extraction.resolution import cell_size
from jointsdf.model.heads import HEADS
from jointsdf.model.trunk import SirenTrunk
from jointsdf.training.settings import FitSettings

CONF = Path(__file__).parents[1] / "conf"
CHOICES = sorted(f"{path.parent.relative_to(CONF)}={path.stem}" for path in CONF.glob("*/**/*.yaml"))
RECIPES = sorted(path.stem for path in (CONF / "recipe").glob("*.yaml"))
ROOTS = sorted(path.stem for path in CONF.glob("*.yaml"))
WEIGHTS = {"dirichlet": 7000, "sign_agnostic": 600, "eikonal": 50, "weingarten": 10, "cross_entropy": 100}


def config(*overrides: str, root: str = "config") -> DictConfig:
    with initialize_config_dir(str(CONF), version_base="1.3"):
        return compose(root, [*overrides])


def plain(cfg: DictConfig) -> dict[str, Any]:
    settings: Any = OmegaConf.to_container(cfg, resolve=True)
    return settings


def components(tree: Any) -> Iterator[dict[str, Any]]:
    """Every node with a `_target_`."""
    if isinstance(tree, dict):
        if "_target_" in tree:
            yield tree
        for branch in tree.values():
            yield from components(branch)


def bind(target: Callable[..., object], given: dict[str, Any], *first: object, partial: bool = False) -> None:
    """Raise TypeError where the target does not take what is given, or wants more."""
    signature = inspect.signature(target)
    (signature.bind_partial if partial else signature.bind)(*first, **given)


def test_there_is_something_to_compose() -> None:
    assert {"loss=paper", "head=siren", "recipe=fast", "optimizer=adam"} <= set(CHOICES)
    assert {"config", "evaluate"} <= set(ROOTS)


@pytest.mark.parametrize("root", ROOTS)
def test_root_composes(root: str) -> None:
    assert config(root=root)


@pytest.mark.parametrize("choice", CHOICES)
def test_every_choice_composes_and_every_component_takes_its_keys(choice: str) -> None:
    if choice.startswith("hydra/"):
        assert config(choice)
        return
    cfg = config(choice)
    settings = plain(cfg)
    found = list(components(settings))
    assert len(found) > 10
    for node in found:
        given = {key: value for key, value in node.items() if not key.startswith("_")}
        bind(get_object(node["_target_"]), given, partial=bool(node.get("_partial_")))
    trunk = settings["trunk"]
    assert (trunk.pop("far"), trunk.pop("far_resolution")) in (("none", 64), ("grid", 64))  # of `JointField`
    bind(SirenTrunk, trunk)
    head = settings["head"]
    bind(HEADS[head.pop("name")], head, 259, 4)
    data = settings["data"]
    bind(Counts, data.pop("counts"))
    bind(ShapeDataModule, {"workers": data.pop("workers")}, None)
    bind(SampleSettings, data)
    taken = inspect.signature(FitSettings).parameters
    assert {"max_steps", "clip", "head_lr", "cosine", "warmup"} <= settings["trainer"].keys() & taken.keys()


@pytest.mark.parametrize("choice", CHOICES)
def test_a_yaml_says_how_it_is_used(choice: str) -> None:
    group, name = choice.split("=")
    text = (CONF / group / f"{name}.yaml").read_text()
    assert text.startswith("#")
    assert "Usage: python " in text


@pytest.mark.parametrize("wrong", ["sed=1", "head=relux", "trunk.widht=8", "loss.weights.eikonol=0"])
def test_typing_errors_do_not_compose(wrong: str) -> None:
    with pytest.raises(Exception, match=wrong.split("=")[0].split(".")[-1]) as caught:
        config(wrong)
    assert isinstance(caught.value, ConfigCompositionException)


@pytest.mark.parametrize("recipe", RECIPES)
def test_command_line_wins_over_the_recipe(recipe: str) -> None:
    for order in (0, 1):
        choices = [f"recipe={recipe}", "loss=paper", "optimizer=adam", "extraction=dense", "trainer.max_steps=17"]
        cfg = config(*(choices if order else reversed(choices)))
        assert cfg.recipe == recipe
        assert plain(cfg.loss) == plain(config("recipe=paper").loss)
        assert cfg.optimizer._target_ == "torch.optim.Adam"
        assert cfg.extraction.method == "dense"
        assert cfg.trainer.max_steps == 17
    cfg = config(f"recipe={recipe}", "loss=flatcad", "optimizer=muon")
    assert plain(cfg.loss) == plain(config("loss=flatcad").loss)
    assert cfg.optimizer._target_ == "jointsdf.optimizers.MuonAdam"


@pytest.mark.parametrize("recipe", RECIPES)
def test_recipe_writes_its_own_name_into_study_and_rows(recipe: str) -> None:
    cfg = config(f"recipe={recipe}")
    assert (cfg.recipe, cfg.study, cfg.variant) == (recipe, recipe, "base")


def test_defaults() -> None:
    cfg = config()
    assert (cfg.recipe, cfg.head.name, cfg.shape, cfg.labels, cfg.resume) == (
        "fast",
        "siren",
        "part_01",
        "auto",
        "auto",
    )
    assert plain(cfg.trunk) == {
        "width": 256, "depth": 5, "omega": 30.0, "hidden_omega": 30.0, "tap": 4, "init": "siren",
        "far": "grid", "far_resolution": 64,
    }  # fmt: skip
    assert cfg.data.cloud_size == 30_000
    assert (cfg.extraction.resolution, cfg.extraction.method) == ("auto", "sparse")


def test_recipe_paper_is_the_papers_training() -> None:
    cfg = config("recipe=paper")
    assert (cfg.optimizer._target_, cfg.optimizer.lr) == ("torch.optim.Adam", 5e-5)
    assert cfg.trainer.max_steps == 10_000
    assert cfg.trainer.clip == 10
    assert (cfg.trainer.cosine, cfg.trainer.warmup, cfg.trainer.head_lr) == (False, 0, None)
    counts = cfg.data.counts
    assert (counts.manifold, counts.non_manifold, counts.shell) == (20_000, 20_000, 20_000)
    assert (counts.balanced, counts.shell_offset) == (0, 0)
    assert (cfg.data.cloud_size, cfg.data.label_fraction) == (30_000, 1)
    assert (cfg.data.part_points, counts.per_part, cfg.trainer.refit) == (0, 0, 0)
    assert (cfg.trunk.hidden_omega, cfg.trunk.tap) == (1, 3)
    assert plain(cfg.loss) == plain(config("loss=paper").loss)
    assert cfg.extraction.resolution == 256


def test_loss_paper() -> None:
    loss = config("loss=paper").loss
    assert plain(loss.weights) == {**WEIGHTS, "signed_distance": 0}
    assert loss.terms.eikonal.form == "squared"
    assert list(loss.terms.eikonal.on) == ["manifold", "non_manifold", "shell"]
    assert loss.terms.weingarten.normalised is True
    assert (loss.terms.weingarten.derivative, loss.terms.weingarten.spacing) == ("exact", 0.05)
    assert loss.terms.sign_agnostic.alpha == 100
    assert loss.schedules.weingarten.form == "constant"


def test_loss_flatcad() -> None:
    loss = config("loss=flatcad").loss
    assert plain(loss.weights) == {**WEIGHTS, "signed_distance": 0}
    assert loss.terms.eikonal.form == "abs"
    assert list(loss.terms.eikonal.on) == ["manifold", "shell"]
    assert loss.terms.weingarten.normalised is False
    assert loss.schedules.weingarten.form == "linear"
    decay = [(share, 10 * factor) for share, factor in loss.schedules.weingarten.knots]
    assert decay == [(0, 10), (0.2, 10), (0.5, pytest.approx(0.001)), (1, 0)]


def test_loss_joint_is_flatcads_forms_divided_and_with_exact_distances() -> None:
    joint, flatcad = plain(config("loss=joint").loss), plain(config("loss=flatcad").loss)
    assert joint["weights"]["signed_distance"] == 7000
    assert joint["terms"]["weingarten"]["normalised"] is True
    joint["weights"]["signed_distance"] = 0
    joint["terms"]["weingarten"]["normalised"] = False
    joint["weights"]["weingarten"] = 10
    assert joint == flatcad
    assert config("recipe=fast").data.counts.pool == 2500


def test_loss_mesh_is_distances_and_normals_in_place_of_what_points_need() -> None:
    loss = plain(config("loss=mesh_near").loss)
    active = {name: weight for name, weight in loss["weights"].items() if weight}
    assert active == {"dirichlet": 7000, "signed_distance": 35000, "normals": 300, "cross_entropy": 100}
    assert loss["terms"].pop("signed_distance") == {
        "_target_": "jointsdf.losses.near_distance.NearDistance",
        "band": 0.01,
        "side": 0.5,
        "clear": 0.1,
    }
    assert loss["terms"].pop("normals") == {"_target_": "jointsdf.losses.normals.Normals"}
    joint = plain(config("loss=joint").loss)
    del joint["terms"]["signed_distance"]
    assert loss["terms"] == joint["terms"]
    assert loss["schedules"] == joint["schedules"]


def test_loss_mesh_has_a_wider_band_and_the_grid_far_away() -> None:
    loss, near = plain(config("loss=mesh").loss), plain(config("loss=mesh_near").loss)
    assert (loss["terms"]["signed_distance"].pop("band"), near["terms"]["signed_distance"].pop("band")) == (0.03, 0.01)
    assert loss == near
    assert [config(f"recipe={name}").trunk.far for name in ("fast", "points", "network", "paper")] == [
        *("grid", "grid"),
        *("none", "none"),
    ]


def test_loss_mesh_far_has_distances_and_gradients_far_away_beside_those_near() -> None:
    loss, near = plain(config("loss=mesh_far").loss), plain(config("loss=mesh_near").loss)
    assert loss["terms"].pop("far_distance") == {"_target_": "jointsdf.losses.far_distance.FarDistance", "band": 0.1}
    assert loss["terms"].pop("far_gradients") == {"_target_": "jointsdf.losses.far_gradients.FarGradients"}
    assert (loss["weights"].pop("far_distance"), loss["weights"].pop("far_gradients")) == (3500, 100)
    assert loss == near
    assert (config().data.counts.far, config("recipe=network").data.counts.far) == (0, 500)


def test_points_takes_nothing_from_the_mesh_but_points_and_labels() -> None:
    cfg = config("recipe=points")
    assert cfg.data.distances == "cloud"
    assert (cfg.data.border_points, cfg.data.region_points, cfg.data.crease_points) == (0, 0, 0)
    assert (cfg.data.counts.borders, cfg.data.counts.regions, cfg.data.counts.creases) == (0, 0, 0)


@pytest.mark.parametrize(
    ("recipe", "loss"),
    [("fast", "mesh"), ("points", "mesh_near loss.weights.eikonal=50"), ("network", "mesh_far"), ("smoke", "joint")],
)
def test_small_recipes_use_the_loss_of_what_they_know(recipe: str, loss: str) -> None:
    found, named = (plain(config(*overrides.split()).loss) for overrides in (f"recipe={recipe}", f"loss={loss}"))
    assert found == named


def test_heads_have_the_methods_sizes() -> None:
    heads = {name: plain(config(f"head={name}").head) for name in HEADS}
    assert heads == {
        "relu": {"name": "relu", "widths": [256, 128], "dropout": 0.2},
        "siren": {"name": "siren", "widths": [256, 128], "omega": 30},
        "hybrid": {"name": "hybrid", "widths": [256, 128], "omega": 30, "dropout": 0.2},
        "deep_skip": {"name": "deep_skip", "widths": [256, 256, 256, 128], "omega": 30},
        "none": {"name": "none"},
    }


def test_evaluation_protocols() -> None:
    evaluation = config().evaluation
    unit, flatcad = evaluation.protocols.unit, evaluation.protocols.flatcad
    assert evaluation.primary == "unit"
    assert (unit.points, unit.frame) == (30_000, "truth")
    assert (flatcad.points, flatcad.frame) == (100_000, "own")
    assert (unit.metrics.normal_consistency.form, flatcad.metrics.normal_consistency.form) == ("cosine", "axes")
    for protocol in (unit, flatcad):
        assert protocol.metrics.f_score.threshold == 0.005
        assert (protocol.metrics.consistency.neighbours, protocol.metrics.consistency.anchors) == (10, 1000)
        assert (protocol.metrics.boundary.spacing, protocol.metrics.boundary.tolerance) == (0.001, 0.01)


def test_rates_fall_on_a_large_surface_and_what_is_out_of_reach_decides_nothing() -> None:
    shape = build.load_shape(config())

    def rate_of(cfg: DictConfig) -> float:
        return build.trunk_rate(cfg, shape, lambda: build.cloud_of(cfg, shape))

    def fingerprint(cfg: DictConfig) -> dict[str, Any]:
        return resolve_settings(cfg, shape, rate_of(cfg))[1]

    assert rate_of(config("trainer.full_rate_area=null")) == 1
    assert rate_of(config("trainer.full_rate_area=20")) == 1
    assert rate_of(config("trainer.full_rate_area=6")) == pytest.approx(6 / 12.77, abs=1e-3)
    runs = (config(f"trainer.full_rate_area={limit}") for limit in ("null", 20, 6))
    by_points = rate_of(config("trainer.full_rate_area=6", "data.distances=cloud"))
    assert by_points == pytest.approx(6 / 12.77, rel=0.05)
    assert by_points != rate_of(config("trainer.full_rate_area=6"))
    free, far, near = (fingerprint(run)["trainer"] for run in runs)
    assert free == far == {key: value for key, value in near.items() if key != "full_rate_area"}
    shares = (config("recipe=points", f"data.counts.regions={share}") for share in (0.0, 0.5))
    without, with_share = (fingerprint(run)["data"] for run in shares)
    assert without == with_share, "a share of no points decides nothing"
    assert "region_points" not in without
    assert fingerprint(config())["data"]["region_points"] == 30000
    assert near["full_rate_area"] == 6


def test_the_grid_begins_without_the_thinnest_wall_where_only_points_are_given() -> None:
    wall = 1.5 * cell_size(256)
    assert build.first_resolution(config(), wall) == 384
    assert build.first_resolution(config("recipe=points"), wall) == 256
    assert build.first_resolution(config("recipe=points", "extraction.resolution=512"), wall) == 512
