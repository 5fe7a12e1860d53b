# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Steps 6 to 8: the gate, the search, names, and the smallest detectable effect.

Import `gate`, `search` and `power`; only `evidence` and `candidates` are imported here.
"""
