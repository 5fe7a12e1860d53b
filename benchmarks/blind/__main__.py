"""`python -m benchmarks.blind`: see commands.py."""

import sys

from benchmarks.blind.commands import main

sys.exit(main())
