# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The slider along many paths of the tip at once, with one prediction of all of them for each window."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from push_predictor.geometry.frames import paired
from push_predictor.geometry.touch import covariance_in_world, displaced, touches
from push_predictor.planning.unscented import LOST, Predict, PusherGeometry
from push_predictor.types import Array, BoolArray

STEEPEST = 1.5  # rad from the inward normal; a steeper tip does not push


@dataclass(frozen=True, eq=False)
class SliderPaths:
    """The slider after each of h steps, on n paths of the tip.

    poses (n, h, 3): means, x, y m, heading rad; covariance (n, h, 3, 3): sum over the windows so far; known (n, h):
    whether the tip kept contact and the model's domain so far.
    """

    poses: Array
    covariance: Array
    known: BoolArray


def slider_paths(
    predict: Predict,
    pusher: PusherGeometry,
    slider: Array,
    tips: Array,
    speeds: Array,
    headings: Array,
    windows: Sequence[int],
) -> SliderPaths:
    """Follow a slider at (3,) while tips from (n, 2) move in h steps at speeds (n, h) m/s in directions (n, h) rad.

    Everything is in the world. predict is called once for each step, with n windows of pusher.window s. A step lasts
    windows (h,) of these, which are taken to be alike.
    """
    poses, covariance = np.tile(slider, (len(tips), 1)), np.zeros((len(tips), 3, 3))
    known, after = np.ones(len(tips), dtype=np.bool_), []
    velocities = speeds[..., None] * paired(np.cos(headings), np.sin(headings))
    for count, velocity in zip(windows, np.swapaxes(velocities, 0, 1), strict=True):
        touch = touches(pusher.outline, poses, tips, velocity)
        known = known & (np.abs(touch.inputs[:, 2]) < STEEPEST) & (touch.distance - pusher.radius < LOST)
        answer = predict(np.clip(touch.inputs, -STEEPEST, STEEPEST))
        known = known & answer.in_domain
        poses = displaced(poses, touch.heading, count * answer.mean)
        tips = tips + count * pusher.window * velocity
        covariance = covariance + count * covariance_in_world(answer.covariance, touch.heading)
        after.append((poses, covariance, known))
    return SliderPaths(*(np.stack(each, axis=1) for each in zip(*after, strict=True)))
