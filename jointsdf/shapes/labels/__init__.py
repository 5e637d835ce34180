"""Part labels of a shape: from files, from B-rep patches, from PartField, or by segmentation."""
