"""The table of classes that a run folder's config may name, and what `trust=` adds to it."""

import re
from pathlib import Path

import pytest
import torch
from hydra.utils import get_class

from jointsdf import moved_names
from jointsdf.errors import InputError
from jointsdf.runs.trusted_targets import TARGETS, require_trusted, targets, trusted_names

CONF = Path(__file__).parents[2] / "conf"
PATH = Path("out/config.yaml")


def named_in(group: str) -> set[str]:
    """Classes in the yaml files of a group of `conf/`."""
    texts = [path.read_text(encoding="utf-8") for path in (CONF / group).glob("*.yaml")]
    return {name for text in texts for name in re.findall(r"_target_: *([\w.]+)", text)}


def test_the_table_is_what_conf_names_and_torchs_optimizers() -> None:
    found = {path.parent.name for path in CONF.glob("*/*.yaml") if "_target_:" in path.read_text(encoding="utf-8")}
    assert found == TARGETS.keys()
    of_torch = {
        f"torch.optim.{name}"
        for name, kind in vars(torch.optim).items()
        if isinstance(kind, type) and issubclass(kind, torch.optim.Optimizer) and kind is not torch.optim.Optimizer
    }
    for group, names in TARGETS.items():
        assert names == named_in(group) | (of_torch if group == "optimizer" else set()), group


@pytest.mark.parametrize("name", sorted(set().union(*TARGETS.values())))
def test_what_the_table_names_is_a_class(name: str) -> None:
    assert isinstance(get_class(name), type)


def test_a_name_of_before_is_that_of_now(monkeypatch: pytest.MonkeyPatch) -> None:
    config = {"extraction": {"_target_": "jointsdf.marching.Extraction"}}
    with pytest.raises(InputError):
        require_trusted(PATH, config)
    monkeypatch.setitem(moved_names.MOVED, "jointsdf.marching", "jointsdf.extraction")
    require_trusted(PATH, config)


MINE = {"loss": {"terms": [{"x": {"_args_": [{"_target_": "mine.losses.Curl"}]}}]}}


@pytest.mark.parametrize("trust", [["mine"], ["mine.losses"], ["mine.losses.Curl"], ["other", "mine"]])
def test_a_module_that_the_user_trusts_may_be_named(trust: list[str]) -> None:
    require_trusted(PATH, MINE, trust)


@pytest.mark.parametrize("trust", [[], ["mine.loss"], ["min"], ["mine.losses.Curl.x"], ["losses"]])
def test_no_other_module_may_be_named(trust: list[str]) -> None:
    with pytest.raises(InputError) as refused:
        require_trusted(PATH, MINE, trust)
    assert str(refused.value).startswith("out/config.yaml: loss.terms.0.x._args_.0._target_ is mine.losses.Curl, ")
    assert "trust=mine.losses allows it" in str(refused.value)


def test_a_file_that_is_named_like_an_interpolation_is_a_name() -> None:
    typed = {"shape": "${part}.stl", "paths": {"abc_root": "a${b"}, "identity": {"shape": {"name": "${part}-1a2b3c"}}}
    require_trusted(PATH, typed)
    with pytest.raises(InputError, match=r"^out/config.yaml: shape_of is an interpolation, "):
        require_trusted(PATH, {"shape_of": "${part}.stl"})


def test_targets_are_found_at_any_depth_and_in_any_order() -> None:
    tree = {"a": [{"b": {"_target_": "m.A", "c": [[{"_target_": {"_target_": "m.B"}}]]}}]}
    keys = ["a.0.b._target_", "a.0.b.c.0.0._target_", "a.0.b.c.0.0._target_._target_"]
    assert [key for key, _ in targets(tree)] == keys


@pytest.mark.parametrize(
    ("given", "names"), [(None, ()), ("mine", ("mine",)), (["a", "b.c"], ("a", "b.c")), ([], ())], ids=str
)
def test_trust_is_one_module_or_several(given: object, names: tuple[str, ...]) -> None:
    assert trusted_names(given) == names


@pytest.mark.parametrize("given", ["", "a.", ".a", "a b", ["a", 3], [""], "a/b"], ids=repr)
def test_what_is_no_module_is_refused(given: object) -> None:
    with pytest.raises(InputError, match=r"^trust="):
        trusted_names(given)
