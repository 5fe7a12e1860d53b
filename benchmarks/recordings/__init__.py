# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Reading damaged bags, and the speed of the rig simulator.

`fuzz_bags` and `simulation` are scripts; `bag_damage` makes the damaged copies.
"""
