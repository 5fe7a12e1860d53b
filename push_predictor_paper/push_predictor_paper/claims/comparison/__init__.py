# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Claims of section VI-B: analytical model, GP and VHGP compared, also by speed.

Sections of the report: `section`, `mean_gain` and `speed_error`.
"""
