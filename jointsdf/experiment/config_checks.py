"""The ranges of the numbers and names in a config that no component checks by itself."""

import math
from collections.abc import Mapping
from typing import Any

from jointsdf.errors import InputError

MOST = 2**31 - 1
INTEGERS = {  # key: smallest and largest value
    "seed": (0, MOST),
    "data.cloud_size": (100, MOST),
    "data.border_points": (0, MOST),
    "data.pool_size": (1, MOST),
    "data.workers": (0, 256),
    "data.counts.manifold": (1, MOST),
    "data.counts.non_manifold": (1, MOST),
    "data.counts.shell": (1, MOST),
    "data.counts.pool": (1, MOST),
    "trunk.width": (1, 65536),
    "trunk.depth": (1, 256),
    "trainer.max_steps": (1, MOST),
    "trainer.log_every": (1, MOST),
    "trainer.preview_every": (0, MOST),
    "trainer.preview_resolution": (8, 256),
}
NUMBERS = {
    "data.label_fraction": (0.0, 1.0),
    "data.pool_near": (0.0, 1.0),
    "data.counts.balanced": (0.0, 1.0),
    "data.counts.borders": (0.0, 1.0),
    "data.counts.shell_offset": (0.0, 1.0),
    "tessellation.tolerance": (1e-6, 0.1),
    "tessellation.angle": (1e-3, 1.0),
    "trainer.clip": (1e-12, math.inf),
    "trainer.warmup": (0.0, 1.0),
    "trainer.checkpoint_seconds": (0.0, math.inf),
}
OPTIONAL = {  # checked where the chosen group has them
    "head.dropout": (0.0, 1.0),
    "head.omega": (1e-6, 1e6),
    "trunk.omega": (1e-6, 1e6),
    "trunk.hidden_omega": (1e-6, 1e6),
    "optimizer.lr": (0.0, 1e6),
    "optimizer.muon_lr": (0.0, 1e6),
    "trainer.head_lr": (0.0, 1e6),
    "trainer.full_rate_area": (1e-6, math.inf),
    "loss.terms.sign_agnostic.alpha": (0.0, math.inf),
}
OPTIONAL_INTEGERS = {  # or a word
    "num_parts": (2, MOST, None),
    "extraction.resolution": (8, 1024, "auto"),
}
CHOICES = {
    "resume": ("auto", "never"),
    "trainer.accelerator": ("auto", "cpu", "gpu"),
    "data.distances": ("mesh", "cloud"),
    "trainer.matmul": ("auto", "default", "onednn"),
    "trainer.backward": ("auto", "float32", "bfloat16"),
    "trainer.orthogonalisation": ("auto", "float32", "bfloat16"),
    "force": (True, False),
    "reuse": (True, False),
}
NAMES = ("study", "variant", "recipe")


def check(settings: Mapping[str, Any]) -> None:
    """Refuse values out of range before any work is done.

    Args:
        settings: The resolved config.

    Raises:
        InputError: The first such value, and what is accepted.
    """
    for key, (least, most) in INTEGERS.items():
        _check_number(key, _at(settings, key), least, most, whole=True)
    for key, (least, most, word) in OPTIONAL_INTEGERS.items():
        if _at(settings, key) != word:
            _check_number(key, _at(settings, key), least, most, whole=True)
    for key, (low, high) in number_keys(settings).items():
        _check_number(key, _at(settings, key), low, high, whole=False)
    for key, accepted in (CHOICES | {"evaluation.primary": tuple(settings["evaluation"]["protocols"])}).items():
        if _at(settings, key) not in accepted:
            listed = ", ".join(str(value).lower() if isinstance(value, bool) else value for value in accepted)
            raise InputError(f"{key}={_at(settings, key)}: accepted are {listed}")
    for key in NAMES:
        name = str(settings[key])
        if not name or set("/\\\0") & set(name) or name.startswith("."):
            raise InputError(f"{key}={name}: it names a folder, give a name without / and not starting with .")


def number_keys(settings: Mapping[str, Any]) -> dict[str, tuple[float, float]]:
    """Every checked key whose value is a real number, with its smallest and largest value."""
    weights = {f"loss.weights.{name}": (0.0, math.inf) for name in settings["loss"]["weights"]}
    return NUMBERS | weights | {key: limits for key, limits in OPTIONAL.items() if _at(settings, key) is not None}


def _at(settings: Mapping[str, Any], key: str) -> Any:
    """The value at a dotted key; None where there is none."""
    value: Any = settings
    for name in key.split("."):
        value = value.get(name) if isinstance(value, Mapping) else None
    return value


def _check_number(key: str, value: Any, low: int | float, high: int | float, *, whole: bool) -> None:
    number = isinstance(value, int if whole else int | float) and not isinstance(value, bool)
    if number and math.isfinite(value) and low <= value <= high:
        return
    limits = f"at least {low:g}" if high in (MOST, math.inf) else f"from {low:g} to {high:g}"
    raise InputError(f"{key}={value}: give {'an integer' if whole else 'a number'}, {limits}")
