# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Claims about repeated pushes: convergent, divergent, multi-modal.

Sections of the report: `kinds_of_push` and `modality`.
"""
