# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Experimental design: which pushes to record next so that a model learns most.

batch.py has the entry, `suggest_pushes`. The other modules are its steps: the pushes that a robot can make, the windows
that they last, what a model is unsure of there, and what a push would add to its knowledge.
"""
