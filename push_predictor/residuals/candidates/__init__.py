# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Step 4: every mechanism with every covariate, and what is regressed out of each candidate.

Import `candidate` and `joint_fit`; only `evidence` is imported here.
"""
