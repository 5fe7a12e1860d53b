# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Planning with single predictions: slider poses in the world, rollouts of push sequences, the choice of a push.

Import `choose`, `goal`, `repertoire`, `rollout` and `slider_pose`; the other modules are their parts. The folder
`obstacles` plans whole sequences of pushes.
"""
