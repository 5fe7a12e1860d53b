# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The streams of `push_validator`: a topic of any type with a pose or wrench, or a frame of tf.

Imported by `nodes.validator.sensor_subscriber` only.
"""
