# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Where an effect may lie: the measurement, the mean motion, its variance, the wrench.

Import one module per channel. All but the motion share the search of `contrast`; a channel imports no later step.
"""
