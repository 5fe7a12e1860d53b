# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Live adaptation after a change of the rig, next to the deployed model, retraining, extension and an oracle.

Run `python -m benchmarks.adaptation`.
"""
