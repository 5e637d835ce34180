"""Phases of a run: a line at the start of each, lines of progress in a pipe, a bar on a terminal."""

import io
import logging
import time
from collections.abc import Iterator

import pytest
from rich.console import Console

from jointsdf import cli_logging, phases
from jointsdf.cli_logging import Lines
from jointsdf.phases import phase, run_named, tell


@pytest.fixture
def lines(caplog: pytest.LogCaptureFixture) -> Iterator[pytest.LogCaptureFixture]:
    with caplog.at_level(logging.INFO, "jointsdf.phases"):
        yield caplog


def test_a_phase_is_named_as_it_begins(lines: pytest.LogCaptureFixture) -> None:
    with phase("load", "part_01"):
        assert lines.messages == ["load: part_01"]
    with run_named("siren part_02"):
        with phase("fit"):
            pass
        with pytest.raises(KeyError), phase("draw"):
            raise KeyError
    with phase("measure"):
        pass
    assert lines.messages == ["load: part_01", "siren part_02: fit", "siren part_02: draw", "measure"]


def test_in_a_pipe_a_long_phase_says_how_far_it_is(
    lines: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(phases, "TICK_SECONDS", 0.05)
    with run_named("relu part_03"), phase("fit"):
        tell(12, 400, "loss 3.1")
        time.sleep(0.18)
        tell(13)
        time.sleep(0.08)
    count = len(lines.messages)
    assert 4 <= count <= 7
    assert lines.messages[1] == "relu part_03: fit: 12 of 400, loss 3.1, 0 s so far"
    assert "13 of 400, loss 3.1" in lines.messages[-1]
    time.sleep(0.12)
    assert len(lines.messages) == count, "and nothing once it has ended"


def test_a_sweep_may_silence_the_names_and_keep_the_long_ones(
    lines: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(phases, "TICK_SECONDS", 0.05)
    logging.getLogger("jointsdf.phases").setLevel(logging.ERROR)
    with phase("extract"):
        tell(facts="1.2 million points evaluated")
        time.sleep(0.08)
    assert lines.messages == ["extract: 1.2 million points evaluated, 0 s so far"]


def test_telling_without_a_phase_does_nothing(lines: pytest.LogCaptureFixture) -> None:
    tell(1, 2, "nobody asked")
    assert lines.messages == []


def test_after_an_inner_phase_the_outer_one_goes_on(
    lines: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(phases, "TICK_SECONDS", 0.05)
    with phase("fit"):
        with phase("draw"):
            tell(5, 6)
        tell(1, 2)
        time.sleep(0.12)
    tell(3, 4)
    assert lines.messages[:2] == ["fit", "draw"]
    assert lines.messages[-1].startswith("fit: 1 of 2")


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> io.StringIO:
    written = io.StringIO()
    screen = Console(file=written, force_terminal=True, width=100, color_system="standard")
    monkeypatch.setattr(phases, "console", screen)
    monkeypatch.setattr(cli_logging, "console", screen)
    return written


def test_on_a_terminal_there_is_a_bar_and_log_lines_stand_above_it(terminal: io.StringIO) -> None:
    logger = logging.Logger("apart")
    logger.addHandler(Lines())
    with run_named("siren part_01"), phase("fit"):
        tell(120, 400, "loss 3.142")
        logger.info("a fact")
        logger.warning("the wall is thin")
        logger.error("error: the disk is full")
        time.sleep(0.15)
    text = terminal.getvalue()
    assert "siren part_01: fit" in text
    assert "120/400" in text
    assert "loss 3.142" in text
    yellow, red = "\x1b[33m", "\x1b[31m"
    assert f"{yellow}warning: the wall is thin" in text
    assert f"{red}error: the disk is full" in text
    assert "\na fact\n" in text.replace("\x1b[2K", "").replace("\r", "\n"), "in no colour"


def test_off_a_terminal_a_warning_says_so_in_words(monkeypatch: pytest.MonkeyPatch) -> None:
    written = io.StringIO()
    monkeypatch.setattr(cli_logging, "console", Console(file=written, width=20))
    logger = logging.Logger("apart")
    logger.addHandler(Lines())
    logger.warning("a line longer than the console is wide, [bold] and all")
    logger.info("a fact")
    assert written.getvalue() == "warning: a line longer than the console is wide, [bold] and all\na fact\n"
