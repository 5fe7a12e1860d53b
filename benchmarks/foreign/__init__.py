# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A rig of planar pushing that is simulated independently of the project, and recordings made on it."""
