# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Where an effect may lie: the measurement, the mean motion, its variance, the force and its zero."""
