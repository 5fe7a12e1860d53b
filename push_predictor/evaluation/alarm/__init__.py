# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The alarm: sequential evidence that a model no longer fits, valid after every push.

Import `evidence` and `scores`.
"""
