# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Data with covariates, the split by push, standardised residuals, regressing the inputs out."""
