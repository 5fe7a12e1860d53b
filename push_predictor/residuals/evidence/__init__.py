# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Steps 1 to 3 and 5: data with covariates, the split by push, standardised residuals, regressing the inputs out.

Import anything; nothing here imports from the later steps.
"""
