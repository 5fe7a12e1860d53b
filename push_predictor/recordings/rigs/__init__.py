# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""New rig files: from the sizes of a shape or the vertices of a polygon, or corrected from a recording.

Import `new_rig`, `polygon_file` and `estimate`.
"""
