# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What a person or a program reads of a trace: page, tables, sentences, JSON.

Import `page`, `summary`, `wording` and `trace_json`; every phrase for a mechanism or covariate comes from `phrases`.
"""
