"""The console command `jointsdf` (Click), and the main functions of `train.py` and `evaluate.py`."""

import logging
import sys
import warnings
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from importlib import import_module
from pathlib import Path

import click
import hydra
from hydra.core.hydra_config import HydraConfig
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf

import jointsdf
from jointsdf.asking.commands import COMMANDS
from jointsdf.cli_logging import configure_logging, user_errors
from jointsdf.errors import InputError
from jointsdf.experiment import arguments, sweep
from jointsdf.experiment import help as help_text
from jointsdf.phases import phase
from jointsdf.runs.row import score_of
from jointsdf.runs.trusted_targets import trusted_names
from jointsdf.user_paths import expand_home

log = logging.getLogger("jointsdf")
failed: list[str] = []  # messages of this command's errors that the user can correct
ANY_WORDS = {"ignore_unknown_options": True, "allow_extra_args": True, "help_option_names": []}


@hydra.main(config_path="conf", config_name="config", version_base="1.3")
def train(cfg: DictConfig) -> float | None:
    """Make one run; returns the primary protocol's cd_l1 to a sweeper."""
    with user_errors(failed):
        configure_logging()
        known = "jointsdf.experiment.run" in sys.modules  # a sweep's later runs find it there
        with nullcontext() if known else phase("start", "torch and lightning"):
            from jointsdf.experiment.run import run  # only after Hydra has accepted the command line
        configure_logging()
        if HydraConfig.get().mode is RunMode.MULTIRUN:
            return sweep.run_one(cfg)
        return score_of(run(cfg), cfg.evaluation.primary, "cd_l1")
    return None


@hydra.main(config_path="conf", config_name="evaluate", version_base="1.3")
def measure_run(cfg: DictConfig) -> None:
    """Measure a finished run again; print every score, and the stored one where it differs."""
    with user_errors(failed):
        configure_logging()
        with phase("start", "torch and lightning"):
            from jointsdf.experiment.measurement import measure_again
        configure_logging()  # loggers that came with it as well
        if OmegaConf.is_missing(cfg, "run"):
            raise InputError("run= is missing; give a finished run's folder: run=outputs/fast/base/siren/part_01/seed0")
        row, scores = measure_again(Path(expand_home(str(cfg.run))), trusted_names(cfg.trust))
        differing = 0
        for protocol, values in scores.items():
            for name, value in values.items():
                stored = row.scores.get(protocol, {}).get(name)
                same = stored is None or stored == value or (stored != stored and value != value)
                differing += not same
                remark = "   not stored" if stored is None else "" if same else f"   stored {stored:.6f}"
                log.info("%-8s %-22s %12.6f%s", protocol, name, value, remark)
        log.info("%s: %s", cfg.run, f"{differing} scores differ" if differing else "every score as stored")


def fit() -> int:
    """Main function of `train.py`: one run, or a sweep, by the arguments of the process.

    Returns:
        Exit code: 2 for an error that the user can correct, 1 for a sweep that is not finished.
    """
    if _asks_for_help():
        click.echo(help_text.fit_help(sys.argv[0]))
        return 0
    if not _arguments_read(arguments.fit_arguments):
        return 2
    warnings.filterwarnings("ignore", r"\s*'hydra/launcher/ray' is validated")  # by the plugin's schema, as intended
    unfinished = 0
    try:
        with user_errors(failed):  # signals also reach an engine that waits for other processes
            train()
            sweep.wait_for_postponed()
    finally:
        unfinished = sweep.sum_up()
    return 2 if failed else min(unfinished, 1)


def evaluate() -> int:
    """Main function of `evaluate.py`: measure a finished run again.

    Returns:
        Exit code: 2 for an error that the user can correct.
    """
    if _asks_for_help():
        click.echo(help_text.evaluate_help(sys.argv[0]))
        return 0
    if not _arguments_read(arguments.evaluate_arguments):
        return 2
    measure_run()
    return 2 if failed else 0


def _arguments_read(read: Callable[[Sequence[str]], list[str]]) -> bool:
    """Put what the user typed into the words that Hydra accepts; False after an error, which is logged."""
    failed.clear()
    with user_errors(failed):
        _require_working_directory()
        sys.argv[1:] = read(sys.argv[1:])
    return not failed


def _require_working_directory() -> None:
    try:
        Path.cwd()
    except FileNotFoundError as error:
        raise InputError("the working directory is deleted: change to another one and run it again") from error


def _asks_for_help() -> bool:
    return bool({"--help", "-h"} & set(sys.argv[1:]))


@click.group(name="jointsdf", context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(jointsdf.__version__, prog_name="jointsdf")
def main() -> None:
    """Neural signed distance fields that know their parts.

    \b
    jointsdf fit head=siren shape=abc_0001     fit, extract and measure one shape
    jointsdf fit -m head=relu,siren,hybrid     several runs
    jointsdf query RUN points.csv --out a.csv  distances, parts, ... of a finished run
    jointsdf COMMAND --help                    all that a command takes
    """  # noqa: D301 (Click reads the backspace)


def _command(name: str, help_line: str, run: Callable[[], int]) -> None:
    """Add a command that parses its own arguments."""

    @main.command(name, context_settings=ANY_WORDS, short_help=help_line, add_help_option=False)
    @click.argument("words", nargs=-1, type=click.UNPROCESSED)
    def command(words: tuple[str, ...]) -> None:
        sys.argv = [f"jointsdf {name}", *words]
        sys.exit(run())


def _main_of(module: str) -> Callable[[], int]:
    """Function that imports a module and runs its `main`."""
    return lambda: int(import_module(module).main() or 0)


_command("fit", "Fit a shape, extract and measure it (train.py).", fit)
_command("evaluate", "Measure a finished run again (evaluate.py).", evaluate)
_command(
    "export", "Write a fitted field as ONNX, numpy arrays or in half precision.", _main_of("jointsdf.export.__main__")
)
_command("study", "Tables, status and committed rows of a study.", _main_of("jointsdf.study.__main__"))
_command("figures", "Figures of the runs.", _main_of("jointsdf.study.figures.__main__"))
_command("view", "Show runs or a study in a browser.", _main_of("jointsdf.study.page.__main__"))
_command("abc", "Download and convert the catalogue's ABC shapes.", _main_of("jointsdf.abc_dataset.command"))
_command("labels", "Import and check part labels.", _main_of("jointsdf.shapes.labels.__main__"))
for asking in COMMANDS:
    main.add_command(asking)


if __name__ == "__main__":
    main()
