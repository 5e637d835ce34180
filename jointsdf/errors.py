"""What the user can mend, as one line. Imports nothing, so that command lines and tables start without torch."""


class InputError(ValueError):
    """What the user gave cannot be used. The message is one line: the value, and the fix."""


def first_line(error: BaseException) -> str:
    """The first line of an error's message, to be quoted in a one-line message."""
    return (str(error).strip() or type(error).__name__).splitlines()[0]
