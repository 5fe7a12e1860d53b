# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Planning of sequences of pushes past obstacles and the table's edges, at a bounded risk.

Import `around_obstacles`, `scene` and `targets`; the other modules are their parts.
"""
