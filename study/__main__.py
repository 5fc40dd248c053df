"""``python -m study`` is ``dovetail``."""

import sys

from study.cli import main

sys.exit(main())
