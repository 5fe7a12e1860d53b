# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The sections of the report, a module each: a function `section(study)` computes figures, tables and pictures.

`push_predictor_paper.report` lists them; `push_predictor_paper.claims` has what each claim requires.
"""
