# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What all report pages share: HTML templates and conventions of figures.

Import `html` and `canvas`.
"""
