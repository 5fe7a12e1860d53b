# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The residual loop: find what a model fails to explain, trace it to an effect, add the effect, score the model again.

Import `trace`, `outcome` and `reporting`. Folders follow the steps of docs/explanation/residual_loop.md and import in
this order: evidence < candidates < selection < channels < extension < reporting < trace.
"""
