# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Replay of a recording without ROS: source, player, and a report with the lateness.

`nodes.push_replay` and its modules add publishers and services; import anything from here.
"""
