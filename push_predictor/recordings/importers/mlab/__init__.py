# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Importers of the MLab's push logs (Zhou et al. 2016) and of its ROS 1 bags.

Import `push_logs` and `bag`; the other modules contain the rig, the force axes and the parser.
"""
