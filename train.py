"""Fit, extract and measure: `python train.py head=siren shape=abc_0001`; many at once with `-m` or `sweeps=main`."""

import sys

from jointsdf.cli import fit

if __name__ == "__main__":
    sys.exit(fit())
