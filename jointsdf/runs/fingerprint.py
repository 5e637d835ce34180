"""Fingerprint of a run: the part of its config that decides its numbers. Two runs of one fingerprint give one row.

A committed row counts as done as long as its fingerprint hashes as it did, so later versions leave the fingerprints of
earlier runs as they are: a new setting goes into `LATER_KEYS`, a new metric needs nothing.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

NUMBERS = ("seed", "tessellation", "data", "trunk", "head", "loss", "optimizer", "trainer", "extraction", "evaluation")
PREVIEWS = ("preview_every", "preview_resolution")
MACHINE = ("accelerator", "checkpoint_seconds", "log_every", *PREVIEWS, "workers", "matmul", "orthogonalisation")
METRICS = (  # of the committed rows; a further metric adds columns to a row and changes none
    *("chamfer", "normal_consistency", "f_score", "segmentation", "consistency"),
    *("surface_distance", "exact_labels", "boundary", "topology"),
)


class LaterKey(NamedTuple):
    """A setting that came after the first committed rows, left out where a run is what it was without it.

    Attributes:
        key: Dotted path in the config.
        neutral: The value at which the setting changes nothing.
        moot: Other later keys, which decide nothing at that value.
    """

    key: str
    neutral: Any
    moot: tuple[str, ...] = ()


LATER_KEYS = (
    LaterKey("optimizer.iterations", "five"),
    LaterKey("data.counts.far", 0),
    LaterKey("trunk.far", "none", moot=("trunk.far_resolution",)),
    LaterKey("extraction.sharp", False),
    LaterKey("extraction.smallest_piece", 0),
    LaterKey("extraction.simplify", 0),
    LaterKey("data.part_points", 0),
    LaterKey("data.denoise", False),
    LaterKey("data.counts.per_part", 0),
    LaterKey("trainer.refit", 0),
    LaterKey("data.region_points", 0, moot=("data.counts.regions",)),  # without such points their share is of nothing
    LaterKey("data.crease_points", 0, moot=("data.counts.creases",)),
    LaterKey("data.corruption.scanner.views", 0, moot=("data.corruption.scanner.noise",)),
    LaterKey("data.corruption.scanner", {}),  # after its keys: nothing is left of it
    LaterKey("data.corruption.density", 1),
    *(LaterKey(f"data.corruption.{name}", 0) for name in ("missing", "outliers", "noise", "label_flip")),
    LaterKey("data.corruption.count", None),
    LaterKey("data.corruption", {}),
)


def fingerprint_of(settings: Mapping[str, Any], **shape: str) -> dict[str, Any]:
    """Everything that decides a run's numbers, and nothing that does not.

    Args:
        settings: The resolved config.
        **shape: Name and hashes of the ground truth.

    Returns:
        The settings of `NUMBERS` without those of the machine, of neutral later keys and of metrics beyond `METRICS`;
        and the shape. The config is not changed.
    """
    fingerprint = {name: settings[name] for name in NUMBERS}
    for group in ("trainer", "data"):
        fingerprint[group] = {key: value for key, value in fingerprint[group].items() if key not in MACHINE}
    for later in LATER_KEYS:
        if _lookup(fingerprint, later.key) == later.neutral:
            for key in (later.key, *later.moot):
                fingerprint = _without(fingerprint, key.split("."))
    for name, protocol in fingerprint["evaluation"]["protocols"].items():
        fingerprint = _without(fingerprint, ["evaluation", "protocols", name, "field"])
        for metric in protocol["metrics"].keys() - set(METRICS):
            fingerprint = _without(fingerprint, ["evaluation", "protocols", name, "metrics", metric])
    return fingerprint | {"shape": shape}


def _lookup(tree: Mapping[str, Any], key: str) -> Any:
    """The value at a dotted key; None where there is none."""
    value: Any = tree
    for name in key.split("."):
        value = value.get(name) if isinstance(value, Mapping) else None
    return value


def _without(tree: Mapping[str, Any], path: Sequence[str]) -> dict[str, Any]:
    """A copy of the tree without the entry at the path, where there is one."""
    name, *below = path
    if not below:
        return {key: value for key, value in tree.items() if key != name}
    inner = tree.get(name)
    return {**tree, name: _without(inner, below)} if isinstance(inner, Mapping) else dict(tree)
