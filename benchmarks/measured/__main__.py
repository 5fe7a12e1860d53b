# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""`python -m benchmarks.measured`: see tables.py."""

from benchmarks.measured.tables import main

main()
