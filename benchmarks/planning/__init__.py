# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Rollouts and planned pushes against the rig simulator.

`mpc_goals`, `rollout` and `risk` are scripts; the other modules belong to them.
"""
