# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Scripts that measure what the documentation reports, one room for each subject, with its tables in RESULTS.md.

Run them from the repository's root as `python -m benchmarks.ROOM.SCRIPT`; nothing in the packages imports them.
"""
