# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Models tabulated over their domain (`tabulated_model`): a prediction takes microseconds."""
