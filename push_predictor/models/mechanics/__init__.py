# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Mechanics of planar pushing: displacements from parameters and pushes (`forward`), and fits of the parameters."""
