"""Components, Euler number and volume of both meshes."""

from dataclasses import dataclass

from jointsdf.geometry.topology import topology
from jointsdf.values import SurfaceSamples


@dataclass(frozen=True)
class Topology:
    """`components`, `euler` and `volume` of the prediction, and the same of the ground truth with `_gt` appended.

    A component is a set of faces connected through shared vertices. euler = vertices - edges + faces. The volume is
    signed (positive where faces are counter-clockwise from outside), in cubic units of the frame of the samples, and
    is meaningful on closed meshes only. All 0 for an empty mesh.
    """

    def __call__(self, predicted: SurfaceSamples, truth: SurfaceSamples) -> dict[str, float]:
        """Count and measure both meshes; see the class."""
        return _in_frame(predicted) | {f"{key}_gt": value for key, value in _in_frame(truth).items()}


def _in_frame(samples: SurfaceSamples) -> dict[str, float]:
    """Topology of the samples' mesh, the volume in the samples' frame."""
    found = topology(samples.mesh)
    return found | {"volume": found["volume"] / samples.frame.scale**3}
