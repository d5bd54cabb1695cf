"""Run the command `talus` as `python -m talus`."""

import sys

from talus.cli import main

sys.exit(main())
