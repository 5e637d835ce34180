"""Segmentation scores against the closest true face, free of sampling noise in the truth."""

from dataclasses import dataclass
from typing import ClassVar

from jointsdf.metrics import confusion_matrix, label_scores, project, score_without_labels
from jointsdf.values import SurfaceSamples


@dataclass(frozen=True)
class ExactLabels:
    """`miou_exact`, `acc_exact`: each predicted sample's label against the label of the closest true face.

    Samples whose closest face is unlabelled do not count. The mean is over the parts on the true mesh's faces; one
    that no sample reaches scores 0. NaN where either mesh has no labels, 0 for an empty prediction.
    """

    ceilings: ClassVar[tuple[str, ...]] = ("miou_exact", "acc_exact")

    def __call__(self, predicted: SurfaceSamples, truth: SurfaceSamples) -> dict[str, float]:
        """Score the prediction; see the class."""
        default = score_without_labels(predicted, truth)
        if default is not None:
            return {"miou_exact": default, "acc_exact": default}
        true = truth.mesh.labels[project(predicted, truth).faces]
        iou, acc = label_scores(confusion_matrix(true, predicted.labels, truth.mesh.part_ids))
        return {"miou_exact": float(iou.mean()), "acc_exact": acc}
