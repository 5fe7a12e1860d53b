# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The figures of a validation report, one module each. `gallery` draws them all, with captions."""
