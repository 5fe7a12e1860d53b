# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Cost and quality of training and prediction in one process. RESULTS.md has the tables."""
