# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Files of a validation run: windows and answers as they come, and the log that is written at the end.

Import anything from here; only `recordings` and `evaluation` are imported in turn.
"""
