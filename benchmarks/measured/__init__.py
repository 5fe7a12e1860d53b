# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Models against pushes measured by others: the tables of RESULTS.md and docs/results/accuracy.md.

Run `python -m benchmarks.measured` and `python -m benchmarks.measured.ladder`; the models' benchmarks import `square`.
"""
