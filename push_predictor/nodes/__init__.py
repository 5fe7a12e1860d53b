# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The ROS 2 nodes `predict_server`, `push_recorder`, `push_replay` and `push_validator`, and what they share.

`server` and `validator` have the parts of one node each, as the modules `replay_*`; nothing else imports from them.
"""
