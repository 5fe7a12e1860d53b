# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Fields of messages of any type: poses, wrenches and scalars, as messages of the types that a recording has.

`columns` reads fields from CDR, `sources` the numbers that a stream needs; `transforms` composes frames, `pose_rows`
turns poses and wrenches, `wrench_bias` estimates the zero of a force sensor.
"""
