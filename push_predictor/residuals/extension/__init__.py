# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The refit, the model with its effects, and the gain on held-out pushes."""
