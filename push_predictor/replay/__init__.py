# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Replay of a recording without ROS: clock, player, range, options, and a report with the lateness.

`nodes.replay` and `nodes.push_replay` add publishers and services; import anything from here.
"""
