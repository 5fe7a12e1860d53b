# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Evaluation of models: metrics, splits, confidence intervals, validation against recordings.

Import `metrics`, `validation`, `offline`, `splits`, `push_scores` and `estimate`. `alarm` detects that a model no
longer fits; `report` writes the page.
"""
