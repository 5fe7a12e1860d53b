# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Frames and axes: begin at stage.py."""
