"""F-score of two sample sets at a distance threshold."""

from dataclasses import dataclass
from typing import ClassVar

from jointsdf.metrics import match
from jointsdf.values import SurfaceSamples


@dataclass(frozen=True)
class FScore:
    """Harmonic mean of precision and recall at a distance threshold: `f1`.

    Precision is the share of predicted samples nearer than the threshold to a true sample, recall the reverse. 0 where
    both are 0, and for an empty prediction.

    Args:
        threshold: In the frame of the samples, where the longest side is 1.
    """

    threshold: float = 0.005
    floors: ClassVar[tuple[str, ...]] = ("f1",)

    def __call__(self, predicted: SurfaceSamples, truth: SurfaceSamples) -> dict[str, float]:
        """Score the prediction; see the class."""
        if len(predicted.points) == 0:
            return {"f1": 0.0}
        found = match(predicted, truth)
        precision = float((found.to_truth < self.threshold).mean())
        recall = float((found.to_predicted < self.threshold).mean())
        return {"f1": 2 * precision * recall / (precision + recall) if precision + recall > 0 else 0.0}
