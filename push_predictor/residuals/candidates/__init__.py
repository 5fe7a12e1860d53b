# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Every mechanism with every covariate, what is regressed out of each, and the joint fit of several."""
