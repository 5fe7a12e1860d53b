# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Live sensor topics: poses composed from tf, and the report about a topic.

Imported by `nodes`; no ROS. The rules of samples are those of `recordings`.
"""
