# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The sub-commands of the command line, one module each.

Each module has `run`, with `add_to` for its parser. It imports numpy, scipy and ROS only when its command runs, so
that --help is fast.
"""
