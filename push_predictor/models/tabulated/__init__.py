# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Models tabulated over their domain: a prediction takes microseconds, whatever the number of training rows.

Import `tabulated_model`; the other modules build and check the tables.
"""
