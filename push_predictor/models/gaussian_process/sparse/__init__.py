# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The VHGP for thousands of rows: variational inference with inducing inputs.

Import `vhgp`; `kernel` is a step of its fit.
"""
