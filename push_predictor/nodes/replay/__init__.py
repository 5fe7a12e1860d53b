# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The ROS side of `push_replay`: parameters, player services, publishers.

Imported by `nodes.push_replay` only.
"""
