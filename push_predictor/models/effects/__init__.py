# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""An effect: a mechanism whose strength depends on a covariate, added to a base model.

Import `effect`; `driver_basis` contains the functions of the covariate, `covariate_range` its observed range.
"""
