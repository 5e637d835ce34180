"""Segmentation heads: part logits from the tapped trunk feature and the point, [f; x]. One file each, one registry."""

from jointsdf.heads.deep_skip import DeepSkipHead
from jointsdf.heads.hybrid import HybridHead
from jointsdf.heads.none import NoHead
from jointsdf.heads.relu import ReluHead
from jointsdf.heads.siren import SirenHead

HEADS = {"relu": ReluHead, "siren": SirenHead, "hybrid": HybridHead, "deep_skip": DeepSkipHead, "none": NoHead}
