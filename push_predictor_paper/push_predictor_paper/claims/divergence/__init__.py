# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Claim: KL divergence of the models from repeated pushes.

`section.section` is the section of the report; the other modules belong to it.
"""
