# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Importer of the MCube lab's preliminary pushes (August 2015).

Import `pushes`; `rig` describes the two blocks and their frames.
"""
