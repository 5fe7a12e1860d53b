# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Steps 6 to 8: screening, forward selection, rivals, names, and the smallest detectable effect.

Import `forward_selection`, `power` and `baseline`; only `evidence` and `candidates` are imported here.
"""
