# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Beyond the paper: are the predicted intervals and distributions calibrated?

`section.section` is the section of the report; the other modules belong to it.
"""
