# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Supports on few points, whose limit surfaces have flats."""

from __future__ import annotations

import numpy as np

from push_predictor.models.mechanics.pressure import supported_at

THREE_POINTS = supported_at(np.array([[0.04, 0.03, 0.3], [-0.04, 0.03, 0.3], [0.0, -0.04, 0.4]]))
FOUR_POINTS = supported_at(np.array([[0.04, 0.04, 0.3], [-0.04, 0.04, 0.2], [-0.04, -0.04, 0.3], [0.04, -0.04, 0.2]]))
TWO_POINTS = supported_at(np.array([[0.03, 0.03, 1.0], [-0.03, -0.03, 1.0]]))
