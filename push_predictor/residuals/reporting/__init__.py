# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What a person or a program reads of a trace: page, tables, sentences, JSON.

Import `page` and `sentences`; phrases and numbers come from `phrases`. The JSON is in `outcome`.
"""
