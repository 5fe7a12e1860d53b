# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The residual loop and the alarm on simulated recordings whose hidden effect they cannot see.

Run `python -m benchmarks.blind`; the demo and the alarm's benchmark import `recordings` and `effects`.
"""
