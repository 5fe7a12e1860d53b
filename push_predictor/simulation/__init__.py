# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A simulated rig: a dynamic pusher-slider on support points, its sensors and its recordings.

Import `rig_simulator` for recordings, `interactive_rig` for single pushes; the other modules are their parts.
"""
