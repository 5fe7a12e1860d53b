# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The pictures of the paper's report."""
