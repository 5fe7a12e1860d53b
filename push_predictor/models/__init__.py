# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Models of one push: from velocity, contact point and angle to the mean and covariance of the displacement."""
