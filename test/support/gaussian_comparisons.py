# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A comparison of outcomes that were drawn from the predicted Gaussians."""

from __future__ import annotations

import numpy as np

from push_predictor.evaluation.validation import Comparison


def gaussian_comparison(sd_factor: float, pushes: int = 400, seed: int = 0) -> Comparison:
    """Outcomes drawn from the predicted Gaussians, whose sd is then multiplied by sd_factor."""
    rng = np.random.default_rng(seed)
    root = np.array([[1.0, 0.0, 0.0], [0.5, 0.8, 0.0], [0.2, -0.3, 0.6]]) * 1e-3
    mean = rng.normal(size=(5 * pushes, 3))
    observed = mean + rng.normal(size=(5 * pushes, 3)) @ root.T
    covariance = np.broadcast_to(sd_factor**2 * root @ root.T, (5 * pushes, 3, 3))
    push_id = np.repeat([f"p{k}" for k in range(pushes)], 5)
    return Comparison("made up", 100, push_id, mean, covariance, observed, None, np.zeros(3))
