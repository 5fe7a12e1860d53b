# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Mechanics of planar pushing: from parameters and pushes to displacements, and fits of the parameters to pushes.

`forward` is the way in, and the compiled `kernel` the one place where a push is computed. `fitted` adds values to it.
"""
