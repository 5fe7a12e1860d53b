# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Claim: the speed up to which the quasi-static assumption holds.

`section.section` is the section of the report; the other modules belong to it.
"""
