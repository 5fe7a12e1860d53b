# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Paths of the tip, how likely they end at a goal, and how likely they touch an obstacle."""

from __future__ import annotations

import numpy as np
import pytest

from push_predictor.geometry.shapes import shape_outline
from push_predictor.models.prediction import Prediction
from push_predictor.planning.goal import Goal
from push_predictor.planning.obstacles.scene import Scene
from push_predictor.planning.tip_paths import slider_paths
from push_predictor.planning.unscented import PusherGeometry

SQUARE = shape_outline("rect1")
PUSHER, TABLE = PusherGeometry(SQUARE, 0.00475, 0.1), np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
NOISE = np.diag([3e-4, 1e-4, 5e-3]) ** 2


def carried(inputs) -> Prediction:
    """A slider that goes where the tip goes, with more noise along the push; it knows only the first two sides."""
    noise = np.tile(NOISE, (len(inputs), 1, 1))
    mean = np.column_stack([PUSHER.window * inputs[:, 0], np.zeros((len(inputs), 2))])
    return Prediction(mean, noise, noise, inputs[:, 1] < 0.5)


def test_a_slider_follows_the_tip_and_its_uncertainty_grows_with_the_windows():
    tips, heading = np.array([[-0.045 - PUSHER.radius, 0.01]]), np.array([[0.5, 0.5]])
    paths = slider_paths(carried, PUSHER, np.zeros(3), tips, np.array([[0.05, 0.03]]), heading, (1, 2))
    along = np.array([np.cos(0.5), np.sin(0.5)])
    np.testing.assert_allclose(paths.poses[0], [[*(0.005 * along), 0.0], [*(0.011 * along), 0.0]], atol=1e-12)
    assert along @ paths.covariance[0, 1, :2, :2] @ along == pytest.approx(3.0 * 3e-4**2)
    assert paths.covariance[0, :, 2, 2] == pytest.approx([5e-3**2, 3.0 * 5e-3**2])
    assert paths.known.all()


def test_a_tip_that_leaves_the_slider_or_the_domain_leads_to_no_known_pose():
    tips = np.array([[-0.045 - PUSHER.radius, 0.0]] * 2 + [[0.045 + PUSHER.radius, 0.0]])
    headings = np.array([[0.0, 0.0, 0.0], [0.0, np.pi, 0.0], [np.pi, np.pi, np.pi]])
    paths = slider_paths(carried, PUSHER, np.zeros(3), tips, np.full((3, 3), 0.05), headings, (1, 1, 1))
    assert paths.known.tolist() == [[True] * 3, [True, False, False], [False] * 3]
    ahead = np.array([0.003, 0.0, 0.0])  # of the tip
    assert not slider_paths(carried, PUSHER, ahead, tips[:1], np.full((1, 1), 0.05), headings[:1, :1], (1,)).known.any()


def test_how_likely_a_goal_is_reached_is_the_mean_over_the_gaussian():
    rng, mean = np.random.default_rng(0), np.array([0.002, -0.001, 0.03])
    covariance = np.array([[4e-6, 1e-6, 1e-5], [1e-6, 2e-6, 0.0], [1e-5, 0.0, 4e-4]])
    drawn, tolerance = rng.multivariate_normal(mean, covariance, 200_000), np.array([0.002, 0.002, 0.05])
    for turn, size in ((0.05, 3), (None, 2)):
        closeness = np.exp(-np.sum((drawn / tolerance)[:, :size] ** 2, axis=1)).mean()
        assert Goal(np.zeros(3), 0.002, turn).likely(mean, covariance) == pytest.approx(closeness, rel=0.02)


def test_an_uncertain_heading_may_touch_an_obstacle_as_an_uncertain_place_may():
    wall = Scene(SQUARE, TABLE, [np.array([[0.05, -1.0], [1.0, -1.0], [1.0, 1.0], [0.05, 1.0]])])
    near = np.array([[0.0, 0.0, 0.0], [0.005, 0.0, 0.0], [0.01, 0.0, 0.0]])
    sideways, turned = np.diag([4e-6, 0.0, 0.0]), np.diag([0.0, 0.0, 4e-6 / SQUARE.reach**2])
    for covariance in (sideways, turned):
        touch = wall.touch_probability(near, np.tile(covariance, (3, 1, 1)))
        np.testing.assert_allclose(touch, [0.00621, 0.5, 0.99379], atol=1e-4)
