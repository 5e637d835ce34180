"""YAML of run folders, which may come from strangers: written without aliases, read in bounds. Imports no torch."""

from typing import Any

import yaml
from yaml.events import AliasEvent, CollectionEndEvent, CollectionStartEvent, ScalarEvent

MOST_BYTES = 1 << 20  # a run's config has 15 kB and 500 values, eight deep
MOST_VALUES = 20_000  # aliases expanded
MOST_CHARACTERS = 10_000  # of one value
DEEPEST = 32


class OutOfBounds(ValueError):
    """A document that no run has written: too large, too deep, or with values that no config has."""


class _PlainDumper(yaml.SafeDumper):
    """Writes a value that stands at two places twice."""

    def ignore_aliases(self, data: Any) -> bool:  # noqa: ARG002 (PyYAML's signature)
        """True: no aliases."""
        return True


def dump_yaml(tree: Any) -> str:
    """The tree as YAML without aliases, in its own order.

    >>> shared = [1]
    >>> print(dump_yaml({"b": shared, "a": shared}))
    b:
    - 1
    a:
    - 1
    <BLANKLINE>
    """
    return yaml.dump(tree, Dumper=_PlainDumper, sort_keys=False)


def parse_yaml(data: bytes) -> Any:
    """Parse a document into mappings with text as keys, lists, text, integers, floats, booleans and None.

    Aliases are expanded, within the bounds: what they would give is counted before anything is built.

    Args:
        data: UTF-8, at most `MOST_BYTES`.

    Raises:
        OutOfBounds: Larger or deeper than a run's config, an alias within its own anchor, or a value of another type.
        yaml.YAMLError: No YAML, or a tag that makes an object.
        ValueError: Not UTF-8, or a number of too many digits.
    """
    if len(data) > MOST_BYTES:
        raise OutOfBounds(f"larger than {MOST_BYTES >> 20} MiB")
    text = data.decode("utf-8")
    _check_events(text)
    try:
        tree = yaml.load(text, Loader=yaml.SafeLoader)
    except RecursionError as error:  # of merge keys, each of which names the one before
        raise OutOfBounds("nested too deeply") from error
    _check_values(tree, 0)
    return tree


def _check_events(text: str) -> None:
    """Count values and depth in the parser's events, which need neither memory nor stack."""
    sizes: dict[str, int] = {}  # values of each anchored node, aliases expanded
    counts: list[int] = [0]  # of the open collections
    anchors: list[str | None] = [None]
    for event in yaml.parse(text, Loader=yaml.SafeLoader):
        if isinstance(event, CollectionStartEvent):
            counts.append(1)
            anchors.append(event.anchor)
        elif isinstance(event, CollectionEndEvent):
            size, anchor = counts.pop(), anchors.pop()
            counts[-1] += size
            if anchor is not None:
                sizes[anchor] = size
        elif isinstance(event, AliasEvent):
            if event.anchor not in sizes:
                raise OutOfBounds("it holds an alias of nothing, or of what it stands in")
            counts[-1] += sizes[event.anchor]
        elif isinstance(event, ScalarEvent):
            counts[-1] += 1
            if len(event.value) > MOST_CHARACTERS:
                raise OutOfBounds(f"a value has more than {MOST_CHARACTERS} characters")
            if event.anchor is not None:
                sizes[event.anchor] = 1
        if len(counts) > DEEPEST:
            raise OutOfBounds(f"nested deeper than {DEEPEST} levels")
        if sum(counts) > MOST_VALUES:
            raise OutOfBounds(f"it holds more than {MOST_VALUES} values")


def _check_values(value: Any, depth: int) -> None:
    """Raise where the tree is deeper than `DEEPEST`, as a chain of aliases makes it, or holds another type."""
    if depth > DEEPEST:
        raise OutOfBounds(f"nested deeper than {DEEPEST} levels")
    if isinstance(value, dict):
        if not all(isinstance(key, str) for key in value):
            raise OutOfBounds("a key is not text")
        value = list(value.values())
    if isinstance(value, list):
        for item in value:
            _check_values(item, depth + 1)
    elif isinstance(value, int) and abs(value) >= 1 << 63:
        raise OutOfBounds("an integer has more than 64 bits")
    elif not isinstance(value, str | int | float | None):
        raise OutOfBounds(f"a value is a {type(value).__name__}")
