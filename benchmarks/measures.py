"""The measures of one mesh by both protocols, against every metric on its own: samples and search trees made anew.

Nothing is kept between repetitions: what is known of a mesh is known of the object, so each has copies of both. The
mesh is `part_01` by its exact distance on the grid of a run. Both cores.
"""

from dataclasses import replace

from benchmarks.scene import built, composed
from benchmarks.table import Row, interleaved
from jointsdf.evaluation.protocol import GroundTruth
from jointsdf.evaluation.reference_scores import ceiling_mesh
from jointsdf.experiment import build

SECONDS = 1.0  # target


def rows(resolution: int = 256, repetitions: int = 5) -> list[Row]:
    """Seconds of both sides; the scores must be the same.

    Args:
        resolution: Grid points along each axis.
        repetitions: The medians are over so many.
    """
    cfg = composed("data.pool_size=20000")
    shape, _, module = built(cfg)
    measures = build.measures(cfg, resolution)
    mesh = ceiling_mesh(shape, measures.extraction, module.field.normalisation)
    found: dict[str, dict[str, dict[str, float]]] = {}

    def together() -> None:
        found["together"] = GroundTruth(replace(shape.mesh), measures.protocols).scores(replace(mesh))

    def alone() -> None:
        found["alone"] = {name: {} for name in measures.protocols}
        for name, protocol in measures.protocols.items():
            for key, metric in protocol.metrics.items():
                one = {name: replace(protocol, metrics={key: metric})}
                found["alone"][name] |= GroundTruth(replace(shape.mesh), one).scores(replace(mesh))[name]

    ours, theirs = interleaved(repetitions, together, alone)
    assert found["together"] == found["alone"], "a metric depends on the others"
    points = " and ".join(f"{protocol.points:,}" for protocol in measures.protocols.values())
    name = f"measures, {points} points, {len(mesh.faces):,} faces"
    return [
        Row(name, "every metric on its own", ours, theirs, "s", theirs / ours),
        Row(
            name,
            "allowed seconds",
            ours,
            SECONDS,
            "s",
            ours / SECONDS,
            1.0 if resolution == 256 else None,
            at_least=False,
        ),
    ]
