# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The data of the claims: simulated recordings, repeated pushes, measured pushes.

Any module may be imported.
"""
