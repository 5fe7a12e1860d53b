# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Parts of the node push_recorder: parameters, subscriptions, status."""
