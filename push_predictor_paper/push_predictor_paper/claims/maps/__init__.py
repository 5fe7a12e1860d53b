# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Claims about the maps of mean and standard deviation over contact and angle.

`section.section` is the section of the report; the noise claims also use `peaks`.
"""
