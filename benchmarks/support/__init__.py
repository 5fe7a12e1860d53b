# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What the independent rigs share that is not physics, and the scripts that print tables.

Nothing here imports push_predictor, so that the rigs stay independent of the code that is judged by them.
"""
