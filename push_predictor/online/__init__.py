# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What the nodes do online, without ROS: sessions, reports about streams, running scores, files, processes.

`nodes.validator` and `nodes.server` add topics, services and the action; import anything from here.
"""
