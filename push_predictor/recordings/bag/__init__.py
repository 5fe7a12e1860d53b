# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""MCAP files and rosbag2 folders as raw messages; damaged files are read as far as possible.

Import `reader`, `writer`, `metadata`, `messages` and `message_types`.
"""
