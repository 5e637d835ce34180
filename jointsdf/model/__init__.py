"""The field: SIREN trunk, segmentation heads, derivatives, and their fused evaluation."""
