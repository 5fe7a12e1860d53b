# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The ROS 2 nodes `predict_server`, `push_replay` and `push_validator`, and what they share.

Each node has a folder for its parts; nothing outside this folder imports from it.
"""
