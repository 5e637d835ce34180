"""Measure a finished run again: `python evaluate.py run=outputs/fast/base/siren/part_01/seed0`."""

import sys

from jointsdf.cli import evaluate

if __name__ == "__main__":
    sys.exit(evaluate())
