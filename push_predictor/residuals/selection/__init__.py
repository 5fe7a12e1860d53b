# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The gate, the search, names, and the smallest detectable effect."""
