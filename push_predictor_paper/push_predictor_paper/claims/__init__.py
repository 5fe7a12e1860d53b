# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""One folder or module per claim: computation, picture, table and verdict.

Each section module has a function `section(study)`; `push_predictor_paper.report` lists them.
"""
