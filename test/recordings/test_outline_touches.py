# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The derivatives of the gaps between tip and outline are those of the gaps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from checked_bags import bag, rig_of

from push_predictor.geometry.shapes import transformed
from push_predictor.recordings.checks.geometry import contacts_of
from push_predictor.recordings.checks.motion import motion_of
from push_predictor.recordings.checks.outline_fit import SIMILARITY, SIZE, SMALLEST, WEAK, Problem

CORRECTION = np.array([0.1, 0.003, -0.002, 0.05, 0.01, 0.001, 0.02, 0.004, 0.003, 0.06, 0.01, 0.002, -0.003])
STEP = 1e-6
NEAR_CORNERS = 0.02  # share of the tips whose nearest side changes within a step


def problem_of(name: str, turn: float = 0.0) -> Problem:
    rig, contacts = rig_of(name), contacts_of(motion_of(bag(name), rig_of(name)))
    assert contacts is not None
    return Problem(contacts, replace(rig, outline=transformed(rig.outline, turn)), SIMILARITY)


@pytest.mark.parametrize(
    ("name", "turn"), [("hexagon_delrin", 0.0), ("ellipse_plywood", 0.0), ("ellipse_plywood", 0.4)]
)
def test_slopes_are_the_derivatives_of_the_gaps(name: str, turn: float) -> None:
    problem, steps = problem_of(name, turn), STEP * np.eye(len(WEAK))
    slopes = problem.slopes(CORRECTION)
    for k, step in enumerate(steps):
        difference = (problem.gaps(CORRECTION + step) - problem.gaps(CORRECTION - step)) / (2.0 * STEP)
        assert np.quantile(np.abs(difference - slopes[:, k]), 1.0 - NEAR_CORNERS) < 1e-6


def test_a_size_that_no_slider_has_changes_nothing() -> None:
    problem, tiny, smallest = problem_of("hexagon_delrin"), np.zeros(len(WEAK)), np.zeros(len(WEAK))
    tiny[SIZE], smallest[SIZE] = SMALLEST - 0.2, SMALLEST
    assert not problem.slopes(tiny)[:, SIZE].any()
    np.testing.assert_array_equal(problem.gaps(tiny), problem.gaps(smallest))


def test_a_fit_knows_the_derivatives_of_the_prior_too() -> None:
    free = np.arange(len(WEAK)) < 5
    problem, part = problem_of("ellipse_plywood"), CORRECTION[free]
    for k, step in enumerate(STEP * np.eye(len(part))):
        difference = (problem.residuals(part + step) - problem.residuals(part - step)) / (2.0 * STEP)
        np.testing.assert_allclose(problem.jacobian(part)[:, k], difference, rtol=1e-4, atol=1e-3)
    prior = problem.jacobian(part)[-len(part) :]
    np.testing.assert_allclose(prior, np.diag(1.0 / WEAK[free]))
