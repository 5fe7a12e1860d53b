# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The nodes as processes: latency, throughput, start-up, load, endurance, replay.

Each module is a script, except `server_under_test` and `vitals`, which the scripts share.
"""
