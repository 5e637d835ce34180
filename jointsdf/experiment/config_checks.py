"""Config values that no component checks by itself, and the keys of real numbers."""

from collections.abc import Mapping
from typing import Any

from jointsdf.errors import InputError, require_number, require_one_of, shown
from jointsdf.runs.row_content import is_folder_name

# Real numbers: 10 and 10.0 are the same config. The components check their ranges.
NUMBERS = (
    *(f"data.{key}" for key in ("label_fraction", "pool_near")),
    *(f"data.counts.{key}" for key in ("balanced", "creases", "borders", "shell_offset")),
    *(f"data.corruption.{key}" for key in ("scanner.noise", "density", "missing", "outliers", "noise", "label_flip")),
    *("tessellation.tolerance", "tessellation.angle"),
    *("trainer.clip", "trainer.warmup", "trainer.checkpoint_seconds"),
)
OPTIONAL = (  # where the chosen group has them
    *("head.dropout", "head.omega", "trunk.omega", "trunk.hidden_omega"),
    *("optimizer.lr", "optimizer.muon_lr", "trainer.head_lr", "trainer.full_rate_area"),
    *("loss.terms.sign_agnostic.alpha", "loss.terms.divergence.low", "loss.terms.divergence.high"),
)
RATES = ("optimizer.lr", "optimizer.muon_lr")  # torch's optimizers name no key
CHOICES = {
    "resume": ("auto", "never"),
    "force": (True, False),
    "reuse": (True, False),
    "part_solids": (None, "ply", "stl"),
    "viewing.page": (True, False),
}
NAMES = ("study", "variant", "recipe")


def check_settings(settings: Mapping[str, Any]) -> None:
    """Refuse values out of range that no component checks.

    Args:
        settings: The resolved config.

    Raises:
        InputError: A value out of range; the first one, and the accepted ones.
    """
    for key, accepted in (CHOICES | {"evaluation.primary": tuple(settings["evaluation"]["protocols"])}).items():
        require_one_of(key, value_at(settings, key), accepted)
    if settings.get("shapes") is not None:
        raise InputError(f"shapes={settings['shapes']}: add sweeps=folder, or give one file as shape=")
    for key in NAMES:
        name = str(settings[key])
        if not is_folder_name(name) or "\\" in name or name.startswith("."):
            fix = "give a name of one line, up to 255 bytes, without / and not starting with ."
            raise InputError(f"{key}={shown(name)}: it names a folder, {fix}")
    for key in RATES:
        if value_at(settings, key) is not None:
            require_number(key, value_at(settings, key), 0, 1e6)
    for key in number_keys(settings):
        require_number(key, value_at(settings, key))


def number_keys(settings: Mapping[str, Any]) -> list[str]:
    """Dotted keys of all real numbers of the config."""
    weights = [f"loss.weights.{name}" for name in settings["loss"]["weights"]]
    return [*NUMBERS, *weights, *(key for key in OPTIONAL if value_at(settings, key) is not None)]


def value_at(settings: Mapping[str, Any], key: str) -> Any:
    """Value at a dotted key; None where there is none.

    >>> value_at({"trainer": {"clip": 10.0}}, "trainer.clip")
    10.0
    """
    value: Any = settings
    for name in key.split("."):
        value = value.get(name) if isinstance(value, Mapping) else None
    return value
