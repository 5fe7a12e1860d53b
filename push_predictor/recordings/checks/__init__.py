# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Checks of recordings and push tables before anything is learnt: units, topics, frames, outline, clocks, coverage.

Import `check` and `finding`; each other module finds one kind of mistake.
"""
