# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The derivatives of the gaps between tip and outline are those of the gaps."""

from __future__ import annotations

import numpy as np
import pytest
from checked_bags import bag, rig_of

from push_predictor.geometry.shapes import transformed
from push_predictor.recordings.checks.frames import contacts_of
from push_predictor.recordings.checks.outline.fit import WEAK, _Problem
from push_predictor.recordings.checks.outline.touches import SIZE, SMALLEST, Touches

CORRECTION = np.array([0.1, 0.003, -0.002, 0.05, 0.01, 0.001, 0.02, 0.004, 0.003, 0.06])
STEP = 1e-6
NEAR_CORNERS = 0.02  # share of the tips whose nearest side changes within a step


def touches(name: str, turn: float = 0.0) -> Touches:
    rig, contacts = rig_of(name), contacts_of(bag(name), rig_of(name))
    assert contacts is not None
    x, y = rig.outline.centroid
    return Touches(contacts, transformed(rig.outline, turn, (-x, -y)), rig.pusher_radius, rig.outline.centroid)


@pytest.mark.parametrize(
    ("name", "turn"), [("hexagon_delrin", 0.0), ("ellipse_plywood", 0.0), ("ellipse_plywood", 0.4)]
)
def test_slopes_are_the_derivatives_of_the_gaps(name: str, turn: float) -> None:
    placed, steps = touches(name, turn), STEP * np.eye(len(WEAK))
    slopes = placed.slopes(CORRECTION)
    for k, step in enumerate(steps):
        difference = (placed.gaps(CORRECTION + step) - placed.gaps(CORRECTION - step)) / (2.0 * STEP)
        assert np.quantile(np.abs(difference - slopes[:, k]), 1.0 - NEAR_CORNERS) < 1e-6


def test_a_size_that_no_slider_has_changes_nothing() -> None:
    placed, tiny, smallest = touches("hexagon_delrin"), np.zeros(len(WEAK)), np.zeros(len(WEAK))
    tiny[SIZE], smallest[SIZE] = SMALLEST - 0.2, SMALLEST
    assert not placed.slopes(tiny)[:, SIZE].any()
    np.testing.assert_array_equal(placed.gaps(tiny), placed.gaps(smallest))


def test_a_fit_knows_the_derivatives_of_the_prior_too() -> None:
    free = np.arange(len(WEAK)) < 5
    problem, part = _Problem(touches("ellipse_plywood"), free), CORRECTION[free]
    for k, step in enumerate(STEP * np.eye(len(part))):
        difference = (problem.residuals(part + step) - problem.residuals(part - step)) / (2.0 * STEP)
        np.testing.assert_allclose(problem.jacobian(part)[:, k], difference, rtol=1e-4, atol=1e-3)
    prior = problem.jacobian(part)[-len(part) :]
    np.testing.assert_allclose(prior, np.diag(1.0 / WEAK[free]))
