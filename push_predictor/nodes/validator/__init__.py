# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""ROS parts of `push_validator`: subscribers, prediction client, publishers, ~/finish, diagnostics.

Imported by `nodes.push_validator` only.
"""
