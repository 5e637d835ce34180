"""Classes that the config of a run folder may name. The folder may come from a stranger, whose classes would run code.

What the user names on the command line is not asked here: it is theirs. Imports no torch.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from jointsdf.errors import InputError, shown
from jointsdf.moved_names import current_name

LOSSES = (
    *("cross_entropy.CrossEntropy", "dirichlet.Dirichlet", "divergence.Divergence", "eikonal.Eikonal"),
    *("far_distance.FarDistance", "far_gradients.FarGradients", "gaussian_curvature.GaussianCurvature"),
    *("near_distance.NearDistance", "normals.Normals", "schedule.Schedule", "sign_agnostic.SignAgnostic"),
    *("signed_distance.SignedDistance", "singular_hessian.SingularHessian", "weingarten.Weingarten"),
)
METRICS = (
    *("boundary.Boundary", "chamfer.Chamfer", "consistency.Consistency", "crease_borders.CreaseBorders"),
    *("crease_normals.CreaseNormals", "distance.Distance", "edges.Edges", "exact_labels.ExactLabels"),
    *("f_score.FScore", "flatness.Flatness", "normal_consistency.NormalConsistency", "segmentation.Segmentation"),
    "specks.Specks",
    *("surface_distance.SurfaceDistance", "topology.Topology"),
)
TORCH_OPTIMIZERS = (
    *("ASGD", "Adadelta", "Adafactor", "Adagrad", "Adam", "AdamW", "Adamax", "LBFGS", "Muon", "NAdam", "RAdam"),
    *("RMSprop", "Rprop", "SGD", "SparseAdam"),
)
TARGETS = {  # group of the config -> what its components may be
    "evaluation": {"jointsdf.evaluation.Protocol", *(f"jointsdf.metrics.{name}" for name in METRICS)},
    "extraction": {"jointsdf.extraction.Extraction"},
    "loss": {f"jointsdf.losses.{name}" for name in LOSSES},
    "optimizer": {"jointsdf.optimizers.MuonAdam", *(f"torch.optim.{name}" for name in TORCH_OPTIMIZERS)},
}
# Values that the user types as they are, e.g. a file named ${part}.stl. No component is built from them.
TYPED = (
    "shape",
    "shapes",
    "labels",
    "truth",
    "truth_labels",
    "partfield_dir",
    "paths",
    "study",
    "variant",
    "identity.shape",
)

TRUST_HELP = "module whose classes a run folder's config may name (repeatable)"


def require_trusted(path: Path, config: Mapping[str, Any], trust: Collection[str] = ()) -> None:
    """Refuse a stored config with a class that is not of the table, or with an interpolation, at any depth.

    An interpolation could show the reader's environment (`${oc.env:...}`); a run writes its values resolved.

    Args:
        path: The config's file, for the message.
        config: Its content.
        trust: Modules or classes that are accepted as well.

    Raises:
        InputError: The key and what it names, in one line with the fix.
    """
    for key, value in _leaves(config, ""):
        is_typed = any(key == name or key.startswith(f"{name}.") for name in TYPED)
        if isinstance(value, str) and "${" in value and not is_typed:
            raise InputError(f"{path}: {shown(key)} is an interpolation, which no run writes; write its value there")
    for key, target in targets(config):
        if not _is_trusted(key, target, trust):
            module = str(target).rpartition(".")[0] or target
            raise InputError(
                f"{path}: {shown(key)} is {shown(target)}, no class that a folder's config may name there: it "
                f"could run code of the folder's maker; trust={shown(module)} allows it for this command"
            )


def targets(tree: Any, key: str = "") -> Iterator[tuple[str, Any]]:
    """Dotted key and name of every class in a config, in lists and arguments too.

    >>> list(targets({"a": [{"_target_": "m.A"}], "_args_": [[{"_target_": "m.B"}]]}))
    [('a.0._target_', 'm.A'), ('_args_.0.0._target_', 'm.B')]
    """
    for name, value in _entries(tree):
        if name == "_target_":
            yield f"{key}{name}", value
        yield from targets(value, f"{key}{name}.")


def trusted_names(trust: Any) -> tuple[str, ...]:
    """The modules of a command's `trust=`: one, a list, or None for none.

    Raises:
        InputError: Not names of modules.
    """
    several = isinstance(trust, Sequence) and not isinstance(trust, str)
    names = () if trust is None else tuple(trust) if several else (trust,)
    for name in names:
        if not isinstance(name, str) or not all(part.isidentifier() for part in name.split(".")):
            raise InputError(f"trust={shown(name)}: give a module, e.g. trust=my_package.losses")
    return names


def _is_trusted(key: str, target: Any, trust: Collection[str]) -> bool:
    if not isinstance(target, str):
        return False
    known = TARGETS.get(key.removeprefix("identity.").partition(".")[0], set())
    return (
        target in known
        or current_name(target) in known
        or any(target == name or target.startswith(f"{name}.") for name in trust)
    )


def _leaves(tree: Any, key: str) -> Iterator[tuple[str, Any]]:
    """Dotted key and value of everything that is neither a mapping nor a list."""
    for name, value in _entries(tree):
        if isinstance(value, dict | list):
            yield from _leaves(value, f"{key}{name}.")
        else:
            yield f"{key}{name}", value


def _entries(tree: Any) -> Iterator[tuple[Any, Any]]:
    if isinstance(tree, Mapping):
        yield from tree.items()
    elif isinstance(tree, list | tuple):
        yield from enumerate(tree)
