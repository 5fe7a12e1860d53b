# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Step 9 and 10: the refit, the model with its effects, their size, and the gain on held-out pushes.

Import `extended_model` and `held_out_gain`.
"""
