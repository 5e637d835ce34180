"""Checked access to the JSON of a glTF file: wrong types and indices are errors of one line."""

import math
from collections.abc import Mapping
from typing import Any

Json = Mapping[str, Any]


def entries(document: Json, key: str) -> list[Json]:
    """Give a list of objects, e.g. `meshes`; an empty one where there is none.

    Raises:
        ValueError: It is something else.
    """
    found = document.get(key, [])
    if not isinstance(found, list) or not all(isinstance(each, dict) for each in found):
        raise ValueError(f"{key} is no list of objects")
    return found


def pick(document: Json, key: str, index: object) -> Json:
    """Give one object of a list by its index.

    Raises:
        ValueError: There is none.
    """
    found = entries(document, key)
    if not isinstance(index, int) or isinstance(index, bool) or not 0 <= index < len(found):
        raise ValueError(f"{key}[{str(index)[:20]}] does not exist, there are {len(found)}")
    return found[index]


def nested(holder: Json, *keys: str) -> Json:
    """Give the object at the end of a path of keys; an empty one where there is none.

    >>> nested({"extras": {"a": {"b": 1}}}, "extras", "a")
    {'b': 1}
    """
    for key in keys:
        found = holder.get(key)
        holder = found if isinstance(found, dict) else {}
    return holder


def integer(holder: Json, key: str, default: int | None = None, least: int = 0) -> int:
    """Give an integer.

    Raises:
        ValueError: It is missing, without a default, or no integer of at least `least`.
    """
    found = holder.get(key, default)
    if not isinstance(found, int) or isinstance(found, bool) or found < least:
        raise ValueError(f"{key} {str(found)[:20]} is no integer of at least {least}")
    return found


def indices(holder: Json, key: str) -> list[int]:
    """Give a list of integers of at least 0; an empty one where there is none.

    Raises:
        ValueError: It is something else.
    """
    found = holder.get(key, [])
    if not isinstance(found, list) or not all(isinstance(each, int) and each >= 0 for each in found):
        raise ValueError(f"{key} is no list of indices")
    return found


def numbers(holder: Json, key: str, default: tuple[float, ...]) -> tuple[float, ...]:
    """Give as many finite numbers as the default has.

    Raises:
        ValueError: It is something else.
    """
    found = holder.get(key, default)
    right = isinstance(found, list | tuple) and len(found) == len(default)
    if not right or not all(isinstance(each, int | float) and math.isfinite(each) for each in found):
        raise ValueError(f"{key} is not {len(default)} finite numbers")
    return tuple(float(each) for each in found)


def name_of(holder: Json) -> str:
    """Give the name of an object, "" where it has none."""
    found = holder.get("name", "")
    return found if isinstance(found, str) else ""
