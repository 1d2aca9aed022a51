"""``python -m softdyn`` is the command ``softdyn``."""

import sys

from softdyn.cli import main

sys.exit(main())
