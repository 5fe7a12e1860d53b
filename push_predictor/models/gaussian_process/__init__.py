# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Gaussian process regression of one output: standard (`gp`), variational heteroscedastic (`vhgp`, `sparse_vhgp`)."""
