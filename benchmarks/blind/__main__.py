# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""`python -m benchmarks.blind`: see commands.py."""

import sys

from benchmarks.blind.commands import main

sys.exit(main())
