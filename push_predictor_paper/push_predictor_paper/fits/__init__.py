# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Models trained on draws of rows and scored on held-out rows.

Import anything.
"""
