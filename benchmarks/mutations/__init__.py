# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Small faults put into the code one at a time: does a test notice each?

python -m benchmarks.mutations --count 300 --seed 1 --out out/mutations.json
python -m benchmarks.mutations --again out/mutations.json --out out/after.json     # the same ones, after a change
"""
