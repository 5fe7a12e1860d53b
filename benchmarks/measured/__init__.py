# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The residual loop on pushes measured by others. RESULTS.md also has the tables of models on measured pushes."""
