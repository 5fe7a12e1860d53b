# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Outcomes of straight pushes of several windows, as one Gaussian of the slider's pose (unscented transform).

A push is a straight line of the tip and lasts several windows. Its first window has the chosen contact. In a later
window the contact, and with it the prediction, depends on how the slider moved. A fraction of the noise is persistent:
its three standard deviates are the same in all windows of a push. Pose and deviates are propagated from window to
window as one Gaussian: twelve sigma points of its mean and covariance, a prediction at each, and the independent part
of the noise is added (Julier and Uhlmann 2004, with equal weights). The position of the tip at the end of a window is
known and the slider touches it, which removes the noise along the normal.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from push_predictor.geometry.frames import rotate
from push_predictor.geometry.outline import Outline
from push_predictor.geometry.touch import Touch, covariance_in_world, displaced, touches
from push_predictor.models.prediction import Prediction
from push_predictor.types import Array, BoolArray, IntArray

SIGMA = np.sqrt(6.0) * np.concatenate([np.eye(6), -np.eye(6)])  # (12, 6), mean 0, covariance 1
POINTS = len(SIGMA)
LOST = 1e-3  # m: mean gap between tip and slider after a window beyond which contact is lost
FLOOR = 1e-18  # m^2, rad^2; makes a zero covariance factorisable
Predict: TypeAlias = Callable[[Array], Prediction]  # of inputs (n, 3), one window each


@dataclass(frozen=True, eq=False)
class PusherGeometry:
    """Geometry of a push: the slider's outline, the tip's radius (m), the duration of a window (s)."""

    outline: Outline
    radius: float
    window: float


def initial_points(count: int) -> Array:
    """Sigma points (count, 12, 6) before the first window: pose zero and known, persistent deviates unknown."""
    return np.broadcast_to(SIGMA * np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0]), (count, POINTS, 6))


@dataclass(frozen=True, eq=False)
class Lines:
    """Lines of the tip in the slider's frame at the start: place (n, 2) m at first contact, velocity (n, 2) m/s."""

    pusher: PusherGeometry
    place: Array
    velocity: Array

    def take(self, rows: IntArray | BoolArray) -> Lines:
        """The given rows (indices or mask)."""
        return Lines(self.pusher, self.place[rows], self.velocity[rows])

    def touches(self, poses: Array, window: int) -> Touch:
        """Contacts (12 n, grouped by push) of sliders (n, 12, 3) at the start of a window."""
        places = np.repeat(self.place + window * self.pusher.window * self.velocity, POINTS, axis=0)
        return touches(self.pusher.outline, poses.reshape(-1, 3), places, np.repeat(self.velocity, POINTS, axis=0))

    def settled(self, poses: Array, window: int) -> tuple[BoolArray, Array]:
        """Shift sliders (n, 12, 3) until the tip touches, and whether the pushes (n,) keep contact.

        A tip is never inside the slider, but it may pass it.
        """
        touch = self.touches(poses, window)
        inward = touch.heading - touch.inputs[:, 2]
        gap = touch.distance - self.pusher.radius
        shift = -gap[:, None] * np.column_stack([np.cos(inward), np.sin(inward), np.zeros_like(inward)])
        in_contact = gap.reshape(poses.shape[:2]).mean(axis=1) < LOST
        return np.asarray(in_contact), np.asarray(poses + shift.reshape(poses.shape))


def tip_lines(pusher: PusherGeometry, inputs: Array) -> Lines:
    """Lines of the tip for pushes that begin with inputs (n, 3)."""
    inward = pusher.outline.inward_normal(inputs[:, 1])
    place = pusher.outline.point(inputs[:, 1]) - pusher.radius * inward
    return Lines(pusher, place, inputs[:, :1] * rotate(inward, inputs[:, 2]))


def propagate(
    predict: Predict, lines: Lines, points: Array, window: int, persistent_fraction: float
) -> tuple[BoolArray, Array]:
    """Propagate one window: which pushes (n,) stay in the domain and in contact, and their sigma points afterwards.

    points (n, 12, 6): the slider's pose and the persistent deviates.
    """
    touch = lines.touches(points[..., :3], window)
    forward = np.abs(touch.inputs[:, 2]) < np.pi / 2.0
    stays: BoolArray = np.asarray(forward.reshape(points.shape[:2]).all(axis=1))
    asked = np.repeat(stays, POINTS)
    answer = predict(touch.inputs[asked])
    inside = answer.in_domain.reshape(-1, POINTS).all(axis=1)
    stays[stays] = inside
    before, heading = points.reshape(-1, 6)[asked], touch.heading[asked]
    root = np.linalg.cholesky(answer.covariance + FLOOR * np.eye(3))
    moved = answer.mean + np.sqrt(persistent_fraction) * np.einsum("nij,nj->ni", root, before[:, 3:])
    after = np.column_stack([displaced(before[:, :3], heading, moved), before[:, 3:]]).reshape(-1, POINTS, 6)
    noise = covariance_in_world(answer.covariance, heading).reshape(-1, POINTS, 3, 3)
    independent = (1.0 - persistent_fraction) * noise.mean(axis=1)
    spread = _spread(after[inside], independent[inside])
    in_contact, spread[..., :3] = lines.take(stays).settled(spread[..., :3], window + 1)
    stays[stays] = in_contact
    return stays, spread[in_contact]


def _spread(points: Array, independent: Array) -> Array:
    """Sigma points (n, 12, 6) with the moments of these points plus independent noise (n, 3, 3) of the pose."""
    mean, covariance = moments(points)
    covariance[:, :3, :3] += independent
    factor = np.linalg.cholesky(covariance + FLOOR * np.eye(6))
    return np.asarray(mean[:, None] + np.einsum("sj,nij->nsi", SIGMA, factor))


def moments(points: Array) -> tuple[Array, Array]:
    """Mean (n, k) and covariance (n, k, k) of points (n, 12, k) of equal weight."""
    mean = points.mean(axis=1)
    away = points - mean[:, None]
    return mean, np.asarray(np.swapaxes(away, 1, 2) @ away / points.shape[1])
