# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The ROS side of `predict_server`: services, the action `trace_residual`, diagnostics.

Imported by `nodes.predict_server` only.
"""
