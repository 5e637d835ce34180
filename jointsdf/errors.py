"""Errors that a user can correct, as one line, and the checks that raise them. Imports no torch."""

import math
from collections.abc import Collection

MAX_INTEGER = 2**31 - 1


class InputError(ValueError):
    """An input cannot be used. The message is one line: the value, and the fix."""


class DamagedFile(InputError):
    """A file of a run or a study cannot be read, or holds what no run writes. The message begins with its path."""


def first_line(error: BaseException) -> str:
    """First line of an error's message, to be quoted in a one-line message.

    >>> first_line(KeyError())
    'KeyError'
    """
    return (str(error).strip() or type(error).__name__).splitlines()[0]


def shown(value: object, most: int = 80) -> str:
    r"""What a file holds, as part of a one-line message: shortened, and with escapes where a terminal would act on it.

    >>> shown("os.system"), shown("abc", 2)
    ('os.system', 'ab...')
    >>> print(shown("\x1b[2J"))
    '\x1b[2J'
    """
    text = str(value)
    text = text if len(text) <= most else f"{text[:most]}..."
    return text if text.isprintable() else ascii(text)


def require_integer(key: str, value: object, least: int, most: int = MAX_INTEGER, *, word: object = None) -> None:
    """Refuse all but integers within the limits.

    Args:
        key: Name of the value in a config, e.g. `data.cloud_size`.
        value: The given value.
        least: Smallest accepted value.
        most: Largest accepted value.
        word: Another accepted value, if any.

    Raises:
        InputError: The message names key, value and limits.

    >>> require_integer("trainer.max_steps", 0, 1)
    Traceback (most recent call last):
    jointsdf.errors.InputError: trainer.max_steps=0: give an integer, at least 1
    """
    if word is not None and value == word:
        return
    if not isinstance(value, int) or isinstance(value, bool) or not least <= value <= most:
        raise InputError(f"{key}={value}: give an integer, {_limits(least, most)}")


def require_number(key: str, value: object, low: int | float = -math.inf, high: int | float = math.inf) -> None:
    """Refuse all but finite numbers from `low` to `high`; arguments as of `require_integer`.

    Raises:
        InputError: The message names key, value and limits.
    """
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not number or not math.isfinite(value) or not low <= value <= high:  # type: ignore[arg-type, operator]
        raise InputError(f"{key}={value}: give a number, {_limits(low, high)}")


def require_one_of(key: str, value: object, accepted: Collection[object]) -> None:
    """Refuse all but the accepted values.

    Raises:
        InputError: The message names key, value and the accepted values.
    """
    if value not in accepted:
        listed = ", ".join(str(one).lower() if isinstance(one, bool) else str(one) for one in accepted)
        raise InputError(f"{key}={value}: accepted are {listed}")


def _limits(low: int | float, high: int | float) -> str:
    if high in (MAX_INTEGER, math.inf):
        return "finite" if low == -math.inf else f"at least {low:g}"
    return f"from {low:g} to {high:g}"
