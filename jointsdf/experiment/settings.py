"""The resolved config as plain values: its run folder, its fingerprint, and errors in it as the user's to correct."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from hydra.errors import HydraException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from jointsdf import shapes
from jointsdf.errors import InputError, first_line
from jointsdf.runs.fingerprint import fingerprint_of
from jointsdf.runs.trusted_targets import targets, trusted_names
from jointsdf.shapes.labels.providers import absolute
from jointsdf.shapes.stored import shape_identity
from jointsdf.user_paths import expand_home
from jointsdf.values import Subject


@contextmanager
def settings_errors(what: str) -> Iterator[None]:
    """Turn errors of constructors about their arguments into input errors.

    Args:
        what: Group or file that the arguments come from.

    Raises:
        InputError: A constructor refused its arguments, or the config cannot be resolved.
    """
    try:
        yield
    except InputError:
        raise
    except (ValueError, TypeError, HydraException, OmegaConfBaseException) as error:
        cause: BaseException = error
        while isinstance(cause, HydraException) and cause.__cause__ is not None:
            cause = cause.__cause__
        if isinstance(cause, InputError):
            raise cause from error
        message = first_line(cause)
        raise InputError(
            message if "=" in message else f"{what}: {message}; change the value in the command"
        ) from error


def resolve(cfg: DictConfig) -> dict[str, Any]:
    """Resolve a config, or a group of one, to plain values.

    Raises:
        InputError: An interpolation cannot be resolved.

    >>> resolve(OmegaConf.create({"a": 1, "b": "${a}"}))
    {'a': 1, 'b': 1}
    """
    with settings_errors("config"):
        settings: Any = OmegaConf.to_container(cfg, resolve=True)
    return dict(settings)


def folder_of(cfg: DictConfig) -> Path:
    """Run folder of a config; the shape is not loaded."""
    name = shapes.name_of(str(cfg.shape), abc_root=cfg.paths.abc_root, abc_missing=cfg.paths.abc_missing)
    names = (cfg.paths.outputs, cfg.study, cfg.variant, cfg.head.name, name, f"seed{cfg.seed}")
    return Path(*map(str, names))  # numbers too: variant=range(3) of a sweep


def resolve_settings(cfg: DictConfig, shape: Subject, rate: float) -> tuple[dict[str, Any], dict[str, Any]]:
    """Resolve a config to settings and fingerprint.

    Args:
        cfg: The composed config.
        shape: What the run is fitted to.
        rate: From `build.trunk_rate`.

    Returns:
        The settings, valid from any working directory, and those of them that decide the run's numbers.
    """
    settings = resolve(cfg)
    settings.pop("trust", None)  # of this command alone
    given = Path(expand_home(str(cfg.shape)))
    settings["shape"] = str(given.resolve()) if given.is_file() and shape.name != str(cfg.shape) else shape.name
    settings["labels"] = absolute(str(cfg.labels))
    if settings["truth"] is not None:
        given = Path(expand_home(str(settings["truth"])))
        settings["truth"] = str(given.resolve()) if given.is_file() else str(settings["truth"])
    settings["truth_labels"] = absolute(str(cfg.truth_labels))
    if settings["partfield_dir"] is not None:
        settings["partfield_dir"] = str(Path(expand_home(str(settings["partfield_dir"]))).resolve())
    settings["paths"]["abc_root"] = str(Path(expand_home(str(cfg.paths.abc_root))).resolve())
    fingerprint = fingerprint_of(settings, **shape_identity(shape))
    if rate == 1:  # a limit that the shape does not reach decides nothing
        del fingerprint["trainer"]["full_rate_area"]
    return settings, fingerprint


def trusted(cfg: DictConfig) -> tuple[str, ...]:
    """What a run folder's config may name in the run of this config: what the user trusts, and what this one names."""
    own = (target for _, target in targets(resolve(cfg)))
    return (*trusted_names(cfg.get("trust")), *map(str, own))


def shared_settings(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Settings that decide numbers and that all runs of one table share: all but head, shape and seed."""
    return {key: value for key, value in fingerprint_of(settings).items() if key not in ("head", "shape", "seed")}
