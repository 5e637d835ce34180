"""What many parts cost: a step of `fast` with 200 parts against one with 6, and the refit of the last layer."""

import time

import numpy as np
import trimesh

from benchmarks.scene import built, composed
from benchmarks.step import total
from benchmarks.table import Row, interleaved
from jointsdf.experiment import build
from jointsdf.threads import large_pieces
from jointsdf.training.last_layer import refit_last_layer
from jointsdf.training.module import JointSDFModule, merged_needs
from jointsdf.values import LabelledMesh, Samples

FEW, MANY = 6, 200
SLOWER = 1.10  # a step with many parts against one with few
REFIT = 4.0  # CPU seconds of the refit, 2 s of two cores


def ball_of_parts(parts: int) -> LabelledMesh:
    """A ball whose parts are the Voronoi cells of random directions, unequal in area."""
    ball = trimesh.creation.icosphere(subdivisions=4)
    directions = np.random.default_rng(0).normal(size=(parts, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    nearest = (np.array(ball.triangles_center) @ directions.T).argmax(axis=1)
    return LabelledMesh(np.array(ball.vertices), np.array(ball.faces), nearest)


@large_pieces()
def rows(repetitions: int = 30, overrides: tuple[str, ...] = ()) -> list[Row]:
    """CPU seconds of all cores; nothing is claimed of a smaller run.

    Args:
        repetitions: Steps that the medians are over.
        overrides: Of the config, to make the run smaller.
    """
    cfg = composed(*overrides)
    scenes = {parts: built(cfg, ball_of_parts(parts)) for parts in (FEW, MANY)}
    steps = [lambda scene=scene: one_step(scene[2], scene[1].sampler.draw(0)) for scene in scenes.values()]
    few, many = interleaved(repetitions, *steps, clock=time.process_time)
    target = None if overrides else SLOWER
    found = [Row(f"step of fast, {MANY} parts", f"{FEW} parts", many, few, "s", many / few, target, at_least=False)]
    for parts, (shape, data, module) in scenes.items():
        module.field.eval()
        start, given = time.process_time(), build.labelled(cfg, shape, data.sampler.cloud)
        refit_last_layer(module.field, given, cfg.trainer.refit)
        taken, target = time.process_time() - start, None if overrides else 1.0
        what = f"refit of the last layer, {parts} parts"
        found.append(Row(what, "allowed CPU seconds", taken, REFIT, "s", taken / REFIT, target, at_least=False))
    return found


def one_step(module: JointSDFModule, samples: Samples) -> None:
    """Gradients of all parameters by one step's samples, without the optimizer's step."""
    weights = module.objective.active_weights(0.0)
    terms = {name: module.objective.terms[name] for name in weights}
    module.zero_grad()
    total(module.evaluate(samples, merged_needs(terms)), terms, weights).backward()
