# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Gaussian process regression of one output: standard (`gp`) and variational heteroscedastic (`vhgp`).

Import `gp`, `vhgp`, `sparse_vhgp`, `regression`, `prediction` and `kernels`; the other modules are steps of their fits.
"""
