# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Claims of section VI-A: `learning_curves`, a section of the report."""
