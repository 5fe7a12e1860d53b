# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""How the report is shown: the page, the place of each claim in the paper, tables as files.

Nothing here computes a result.
"""
