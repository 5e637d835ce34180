"""Entry point of `python -m jointsdf.shapes.abc prepare`."""

import sys

from jointsdf.abc_dataset.command import main

sys.exit(main())
