# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The validation report: one HTML page with tables, maps and figures.

Import `page`; the other modules are its parts.
"""
