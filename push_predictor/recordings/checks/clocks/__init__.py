# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Clocks of the streams against each other: begin at stage.py."""
