# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Claims about the size and the shape of the noise.

`section.section` is the section of the report; the other modules belong to it.
"""
