# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The four kinds of picture: curves, maps over contact and angle, histograms, trajectories."""
