# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The results of Bauza and Rodriguez (ICRA 2017), reproduced on simulated and on measured pushes.

Import `report`, `plan` and `work`, as the command `push_predictor report paper` does. push_predictor itself imports
nothing of this package except in that command.
"""
