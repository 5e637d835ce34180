"""`python -m jointsdf.shapes.abc prepare`."""

import sys

from jointsdf.preparation.command import main

sys.exit(main())
