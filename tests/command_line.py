"""Runs of the real command line, in this process: the same as a user's, without seconds of imports for each."""

import atexit
import contextlib
import io
import logging
import runpy
import shutil
import sys
import tempfile
import warnings
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from unittest import mock

from jointsdf.experiment import result
from jointsdf.viewing import points
from jointsdf.viewing.render import render_comparison
from jointsdf.viewing.slice import render_slice

ROOT = Path(__file__).parents[1]
FILES = {  # of a finished run's folder
    "config.yaml",
    "field.ckpt",
    "labels.json",
    "labels.npy",
    "mesh.glb",
    "mesh.ply",
    "preview.png",
    "result.json",
    "tb",
}
QUICK = (  # a run of about two seconds; the mesh is worthless
    "recipe=smoke",
    "viewing.page=false",
    "trainer.max_steps=4",
    "trainer.preview_every=0",
    "trainer.preview_resolution=12",
    "trainer.log_every=1",
    "trainer.accelerator=cpu",
    "extraction.resolution=16",
    "data.pool_size=300",
    "data.cloud_size=1000",
    "data.counts.manifold=40",
    "data.counts.non_manifold=40",
    "data.counts.shell=40",
    "data.counts.pool=40",
    "evaluation.protocols.unit.points=300",
    "evaluation.protocols.flatcad.points=300",
)
PLACE = Path("smoke/base/siren/part_01/seed0")  # of such a run below its outputs folder


@dataclass(frozen=True)
class Answer:
    """What a command gave: exit code and everything that it wrote."""

    code: int
    text: str

    @property
    def lines(self) -> list[str]:
        return self.text.splitlines()


def call(script: str, *arguments: object) -> Answer:
    """`python <script> <arguments>` in this process and working directory."""
    written = io.StringIO()
    thumbnail = partial(render_comparison, width=96, height=72)  # pictures are most of a quick run's time
    handler = logging.StreamHandler(written)
    coarse = partial(render_slice, raster=20)
    root, quieted, phases = (
        logging.getLogger(name) for name in (None, "jointsdf.extraction.extractor", "jointsdf.phases")
    )
    before = sys.argv, root.level, quieted.level, phases.level
    sys.argv = [str(ROOT / script), *map(str, arguments)]
    root.addHandler(handler)
    root.setLevel(logging.INFO)
    phases.setLevel(logging.WARNING)  # that a phase begins is said in every run, and not what is asked of most
    code = 0
    try:
        with contextlib.ExitStack() as stack:
            stack.enter_context(contextlib.redirect_stdout(written))
            stack.enter_context(contextlib.redirect_stderr(written))
            stack.enter_context(warnings.catch_warnings())
            stack.enter_context(mock.patch.object(points, "render_comparison", thumbnail))
            stack.enter_context(mock.patch.object(result, "render_slice", coarse))
            warnings.simplefilter("default")
            runpy.run_path(sys.argv[0], run_name="__main__")
    except SystemExit as stop:
        code = int(stop.code or 0)
    finally:
        logging.captureWarnings(False)
        root.removeHandler(handler)
        sys.argv, *levels = before
        for logger, level in zip((root, quieted, phases), levels, strict=True):
            logger.setLevel(level)
    return Answer(code, written.getvalue())


def train(outputs: Path, *overrides: str) -> Answer:
    """A quick run of train.py, or with `-m` several."""
    flags = overrides[:1] if overrides[:1] == ("-m",) else ()
    return call("train.py", *flags, *QUICK, f"paths.outputs={outputs}", *overrides[len(flags) :])


def assert_one_line_error(answer: Answer, *named: str) -> None:
    """One line that names the value and the fix; warnings about the mesh may come before it."""
    assert answer.code == 2, answer.text
    assert "Traceback" not in answer.text
    errors = [line for line in answer.lines if line.startswith("error: ")]
    assert errors == answer.lines[-1:], answer.text
    for name in named:
        assert name in errors[0], errors[0]


@cache
def finished() -> Path:
    """The folder of a finished quick run, for all tests of the session; they only read it."""
    outputs = Path(tempfile.mkdtemp())
    atexit.register(shutil.rmtree, outputs, ignore_errors=True)
    answer = train(outputs, "trainer.preview_every=2")
    assert answer.code == 0, answer.text
    return outputs / PLACE
