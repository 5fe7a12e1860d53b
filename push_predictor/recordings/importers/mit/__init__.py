# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Importers of the MIT push data set and of the `mit_square` table made from it.

Import `pushes` and `square_windows`; `source` and `listing` read the files.
"""
