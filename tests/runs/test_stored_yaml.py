"""YAML of run folders: what a run writes reads as PyYAML reads it, within bounds."""

from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from jointsdf.runs.stored_yaml import (
    DEEPEST,
    MOST_BYTES,
    MOST_CHARACTERS,
    MOST_VALUES,
    OutOfBounds,
    dump_yaml,
    parse_yaml,
)

STORED = Path(__file__).parents[1] / "stored"
LEAVES = st.none() | st.booleans() | st.integers(-(2**62), 2**62) | st.floats(allow_nan=False) | st.text(max_size=20)
TREES = st.recursive(LEAVES, lambda inner: st.lists(inner) | st.dictionaries(st.text(max_size=9), inner), max_leaves=20)


@pytest.mark.parametrize("name", ["finished", "stopped"])
def test_a_config_of_before_reads_as_it_did_though_it_has_aliases(name: str) -> None:
    data = (STORED / name / "config.yaml").read_bytes()
    assert b"*id001" in data
    config = parse_yaml(data)
    assert config == yaml.safe_load(data)
    written = dump_yaml(config)
    assert not [event for event in yaml.parse(written) if getattr(event, "anchor", None)]
    assert parse_yaml(written.encode()) == config
    assert list(yaml.safe_load(written)) == list(config)


@given(TREES)
def test_what_is_written_is_read(tree: Any) -> None:
    assert parse_yaml(dump_yaml({"a": tree, "b": tree}).encode()) == {"a": tree, "b": tree}


@pytest.mark.parametrize(
    "name", ["Teile \udcff", "\U0001f529", "a\u0085b", "\ufeff", "'\"#: {[", "null", "1e3", "<<", "2020-01-01"]
)
def test_any_name_of_a_file_or_folder_is_read_as_it_was(name: str) -> None:
    """A working directory whose name is no UTF-8 is in the paths of a config."""
    assert parse_yaml(dump_yaml({"shape": name, name: 1}).encode()) == {"shape": name, name: 1}


def nested(levels: int) -> bytes:
    return f"{'[' * levels}{']' * levels}".encode()


def doubled(times: int) -> bytes:
    """An anchor of 2 values, each next one with twice those of the one before."""
    lines = ["a0: &a0 [x]", *(f"a{k}: &a{k} [*a{k - 1}, *a{k - 1}]" for k in range(1, times))]
    return "\n".join(lines).encode()


def chained(levels: int) -> bytes:
    lines = ["a0: &a0 []", *(f"a{k}: &a{k} [*a{k - 1}]" for k in range(1, levels))]
    return "\n".join(lines).encode()


WITHIN = {
    "bytes": b"a: 1\n#".ljust(MOST_BYTES, b"x"),
    "values": f"[{'1,' * (MOST_VALUES - 1)}]".encode(),
    "characters": b"x" * MOST_CHARACTERS,
    "levels": nested(DEEPEST - 1),
    "levels of aliases": chained(DEEPEST - 1),
    "aliases": doubled(12),
    "integer": str(2**63 - 1).encode(),
}
BEYOND = {
    "bytes": (WITHIN["bytes"] + b"x", "larger"),
    "values": (f"[{'1,' * MOST_VALUES}]".encode(), "more than 20000 values"),
    "characters": (b"x" * (MOST_CHARACTERS + 1), "characters"),
    "levels": (nested(DEEPEST + 1), "nested deeper"),
    "levels of aliases": (chained(DEEPEST + 2), "nested deeper"),
    "aliases": (doubled(40), "more than 20000 values"),
    "integer": (str(2**63).encode(), "64 bits"),
    "date": (b"2020-01-01", "date"),
    "bytes of base64": (b"!!binary aGVsbG8=", "bytes"),
    "set": (b"!!set {a}", "set"),
    "pairs": (b"!!pairs [a: b]", "tuple"),
    "key": (b"{1: 2}", "not text"),
    "alias in its anchor": (b"&a [*a]", "alias"),
    "alias of nothing": (b"[*a]", "alias"),
}


@pytest.mark.parametrize("name", WITHIN)
def test_what_is_within_the_bounds_is_read_as_pyyaml_reads_it(name: str) -> None:
    assert parse_yaml(WITHIN[name]) == yaml.safe_load(WITHIN[name])


@pytest.mark.parametrize("name", BEYOND)
def test_what_is_beyond_them_is_refused(name: str) -> None:
    data, named = BEYOND[name]
    with pytest.raises(OutOfBounds, match=named):
        parse_yaml(data)


@pytest.mark.parametrize(
    "data", [b"!!python/object/apply:os.system [true]", b"!x y", b"[", b"a: b: c", b"- &a\n- &a x: *"]
)
def test_tags_and_damage_are_yamls_own_errors(data: bytes) -> None:
    with pytest.raises(yaml.YAMLError):
        parse_yaml(data)


def test_text_that_is_not_utf8_is_a_value_error() -> None:
    with pytest.raises(ValueError, match="utf-8"):
        parse_yaml(b"a: \xff")
