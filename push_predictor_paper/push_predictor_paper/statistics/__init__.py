# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Statistics of repeated pushes and of maps: modes, peaks, noise.

Import anything.
"""
