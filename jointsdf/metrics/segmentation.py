"""Segmentation scores (mIoU, accuracy) against the labels of the nearest true samples."""

from dataclasses import dataclass
from typing import ClassVar

from jointsdf.metrics import confusion_matrix, label_scores, match, score_without_labels
from jointsdf.values import SurfaceSamples


@dataclass(frozen=True)
class Segmentation:
    """`miou`, `acc` and `iou_<part id>` from one confusion matrix; `parts_pred`, `parts_gt` from face labels.

    Every predicted sample gets the label of its nearest true sample as its true label; where that is -1 the sample does
    not count. `miou` is the mean over the parts on the true mesh's faces: one that is never predicted, or that no
    sample hits, scores 0. A predicted -1 or a predicted part that the truth lacks is a wrong label.
    All NaN where either mesh has no labels, all 0 for an empty prediction.
    """

    floors: ClassVar[tuple[str, ...]] = ("miou", "acc")
    ceilings: ClassVar[tuple[str, ...]] = ("parts_pred",)

    def __call__(self, predicted: SurfaceSamples, truth: SurfaceSamples) -> dict[str, float]:
        """Score the prediction; see the class."""
        part_ids = truth.mesh.part_ids
        parts = {"parts_pred": float(len(predicted.mesh.part_ids)), "parts_gt": float(len(part_ids))}
        default = score_without_labels(predicted, truth)
        if default is not None:
            return {"miou": default, "acc": default} | {f"iou_{part}": default for part in part_ids} | parts
        carried = truth.labels[match(predicted, truth).nearest_truth]
        iou, acc = label_scores(confusion_matrix(carried, predicted.labels, part_ids))
        per_part = {f"iou_{part}": float(value) for part, value in zip(part_ids, iou, strict=True)}
        return {"miou": float(iou.mean()), "acc": acc} | per_part | parts
