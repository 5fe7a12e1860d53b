# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What a person or a program reads of a trace: page, tables, sentences, JSON.

Import `page`, `summary`, `sentences` and `trace_json`; phrases and numbers come from `phrases`.
"""
