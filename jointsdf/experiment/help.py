"""Help of `train.py` and `evaluate.py`, made from the yaml files and their comments. Imports no torch."""

import re
import textwrap
from collections.abc import Iterator, Mapping
from importlib import resources

CONF = resources.files("jointsdf").joinpath("conf")
GROUPS = (
    *("recipe", "head", "loss", "optimizer", "trunk", "data", "extraction", "evaluation", "trainer", "logger"),
    "sweeps",
)
KEY = re.compile(r"^(?P<key> *[\w.]+): *(?P<value>[^#]*?) *(?:# *(?P<comment>.*))?$")
HIDDEN = ("defaults", "hydra")
DEFAULT = re.compile(r"^  - (\w+): (\w+)$", re.MULTILINE)  # of the defaults list
WIDTH, COLUMN = 120, 32


def fit_help(program: str) -> str:
    """Help of a run: values with their comments, and groups with their choices.

    Args:
        program: Name of the command.
    """
    config = CONF.joinpath("config.yaml").read_text(encoding="utf-8")
    defaults = dict(DEFAULT.findall(config))
    lines = [
        f"Usage: {program} [key=value ...]              one run: fit, extract and measure a shape",
        f"       {program} part.stl | my_parts/         a mesh or STEP file; a run of each file of a folder",
        f"       {program} -m head=relu,siren [...]     every combination of the values",
        f"       {program} sweeps=main [...]            a stored study",
        "",
        "Values:",
        *_values(config),
        "",
        "Groups (* default, unless the recipe chooses another); a key of one, e.g. trainer.max_steps=800:",
        *(_wrap(f"  {group:<12} ", " | ".join(_star_default(group, defaults))) for group in GROUPS),
        "",
        f"{program} --cfg job [key=value ...] prints every key and value; a group's file says what each means.",
        f"{program} --hydra-help: Hydra's own options, among them shell completion.",
    ]
    return "\n".join(lines)


def evaluate_help(program: str) -> str:
    """Help of measuring a run again."""
    values = _values(CONF.joinpath("evaluate.yaml").read_text(encoding="utf-8"))
    example = "outputs/fast/base/siren/part_01/seed0"
    return "\n".join(
        [
            f"Usage: {program} run=FOLDER",
            "",
            "Extracts and measures a finished run again from its field, and compares with its stored scores.",
            "",
            *values,
            "",
            f"e.g. {program} run={example}",
        ]
    )


def _values(text: str) -> Iterator[str]:
    """Lines of a yaml file's keys with value and comment; nested keys by their dotted names."""
    section, hidden = "", False
    for line in text.splitlines():
        found = KEY.match(line)
        if found is None:
            continue
        key, value, comment = found["key"], found["value"], found["comment"] or ""
        if not key.startswith(" "):
            section, hidden = key, key in HIDDEN
        if hidden or not value:
            continue
        name = key if not key.startswith(" ") else f"{section}.{key.strip()}"
        yield _wrap(f"  {f'{name}={value}':<{COLUMN}} ", comment)


def choices(group: str) -> list[str]:
    """Choices of a config group, in alphabetical order."""
    files = (path.name for path in CONF.joinpath(group).iterdir())
    return sorted(name.removesuffix(".yaml") for name in files if name.endswith(".yaml"))


def _star_default(group: str, defaults: Mapping[str, str]) -> list[str]:
    return [f"{name}*" if name == defaults.get(group) else name for name in choices(group)]


def _wrap(start: str, text: str) -> str:
    """Wrap a line with hanging indent."""
    hanging = " " * len(start)
    return textwrap.fill(text, WIDTH, initial_indent=start, subsequent_indent=hanging, break_long_words=False) or start
