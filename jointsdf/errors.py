"""Errors that a user can mend, as one line, and the checks that raise them. Imports no torch."""

import math
from collections.abc import Collection

LARGEST = 2**31 - 1


class InputError(ValueError):
    """An input cannot be used. The message is one line: the value, and the fix."""


def first_line(error: BaseException) -> str:
    """The first line of an error's message, to be quoted in a one-line message."""
    return (str(error).strip() or type(error).__name__).splitlines()[0]


def require_integer(key: str, value: object, least: int, most: int = LARGEST, *, word: object = None) -> None:
    """Refuse what is not a whole number within the limits.

    Args:
        key: Name of the value in a config, e.g. `data.cloud_size`.
        value: What was given.
        least: Smallest accepted value.
        most: Largest accepted value.
        word: A value accepted beside the numbers, where there is one.

    Raises:
        InputError: Naming key, value and limits.
    """
    if word is not None and value == word:
        return
    if not isinstance(value, int) or isinstance(value, bool) or not least <= value <= most:
        raise InputError(f"{key}={value}: give an integer, {_limits(least, most)}")


def require_number(key: str, value: object, low: int | float = -math.inf, high: int | float = math.inf) -> None:
    """Refuse what is not a finite number from `low` to `high`; the arguments are those of `require_integer`.

    Raises:
        InputError: Naming key, value and limits.
    """
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not number or not math.isfinite(value) or not low <= value <= high:  # type: ignore[arg-type, operator]
        raise InputError(f"{key}={value}: give a number, {_limits(low, high)}")


def require_one_of(key: str, value: object, accepted: Collection[object]) -> None:
    """Refuse what is not among the accepted values.

    Raises:
        InputError: Naming key, value and what is accepted.
    """
    if value not in accepted:
        listed = ", ".join(str(one).lower() if isinstance(one, bool) else str(one) for one in accepted)
        raise InputError(f"{key}={value}: accepted are {listed}")


def _limits(low: int | float, high: int | float) -> str:
    if high in (LARGEST, math.inf):
        return "finite" if low == -math.inf else f"at least {low:g}"
    return f"from {low:g} to {high:g}"
