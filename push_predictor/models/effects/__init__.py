# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""An effect: a mechanism whose strength depends on a covariate, added to a base model."""
