"""Segmentation heads: part logits from the tapped trunk feature and the point, [f; x]. One file each, one registry."""

from jointsdf.model.heads.deep_skip import DeepSkipHead
from jointsdf.model.heads.hybrid import HybridHead
from jointsdf.model.heads.none import NoHead
from jointsdf.model.heads.relu import ReluHead
from jointsdf.model.heads.siren import SirenHead

HEADS = {"relu": ReluHead, "siren": SirenHead, "hybrid": HybridHead, "deep_skip": DeepSkipHead, "none": NoHead}
