# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The streams by themselves: begin at stage.py."""
