"""Where straight pushes lead, window after window, as one Gaussian of the slider's pose.

A push is a straight line of the tip, as long as some windows of the model. Its first window is the contact that was
chosen; where the tip touches in a later one depends on how the slider went, and so does what the model predicts there.
Of what a window scatters a share lasts: it is the same, in standard deviations, in all windows of a push. The pose and
these three deviations are carried from window to window as one Gaussian by the unscented transform: twelve points of
its mean and covariance, a prediction at each, and what scatters anew is added (Julier and Uhlmann 2004, with equal
weights). Where the tip is at the end of a window is known, and the slider touches it: that takes back what the windows
scatter along the normal.
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
LOST = 1e-3  # m between tip and slider after a window, on average
FLOOR = 1e-18  # m^2, rad^2; so that a covariance of zero has a Cholesky factor
Predict: TypeAlias = Callable[[Array], Prediction]  # of inputs (n, 3), one window each


@dataclass(frozen=True, eq=False)
class PusherGeometry:
    """What pushes: the slider's outline, the tip's radius (m), the length of a window (s)."""

    outline: Outline
    radius: float
    window: float


def initial_points(count: int) -> Array:
    """The points (count, 12, 6) before the first window: the pose is known, zero; what will last is not."""
    return np.broadcast_to(SIGMA * np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0]), (count, POINTS, 6))


@dataclass(frozen=True, eq=False)
class Lines:
    """The tip's lines in the frame of the slider at the start: place (n, 2) m at the touch, velocity (n, 2) m/s."""

    tip: PusherGeometry
    place: Array
    velocity: Array

    def take(self, rows: IntArray | BoolArray) -> Lines:
        """The given rows (indices or mask)."""
        return Lines(self.tip, self.place[rows], self.velocity[rows])

    def touches(self, poses: Array, window: int) -> Touch:
        """When a window begins, at sliders (n, 12, 3): 12 n, those of a push together."""
        places = np.repeat(self.place + window * self.tip.window * self.velocity, POINTS, axis=0)
        return touches(self.tip.outline, poses.reshape(-1, 3), places, np.repeat(self.velocity, POINTS, axis=0))

    def settled(self, poses: Array, window: int) -> tuple[BoolArray, Array]:
        """Sliders (n, 12, 3) shifted until the tip just touches, and whether those of a push (n,) had little to go: a
        tip is never inside what it pushes, but it may pass it by.
        """
        touch = self.touches(poses, window)
        inward = touch.heading - touch.inputs[:, 2]
        gap = touch.distance - self.tip.radius
        shift = -gap[:, None] * np.column_stack([np.cos(inward), np.sin(inward), np.zeros_like(inward)])
        in_contact = gap.reshape(poses.shape[:2]).mean(axis=1) < LOST
        return np.asarray(in_contact), np.asarray(poses + shift.reshape(poses.shape))


def tip_lines(tip: PusherGeometry, inputs: Array) -> Lines:
    """The lines of pushes that begin with inputs (n, 3)."""
    inward = tip.outline.inward_normal(inputs[:, 1])
    place = tip.outline.point(inputs[:, 1]) - tip.radius * inward
    return Lines(tip, place, inputs[:, :1] * rotate(inward, inputs[:, 2]))


def propagate(
    predict: Predict, lines: Lines, points: Array, window: int, persistent_fraction: float
) -> tuple[BoolArray, Array]:
    """Which pushes (n,) stay in the domain and at the slider, and the points of those afterwards.

    points (n, 12, 6): the slider's pose and the deviations that last.
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
    anew = (1.0 - persistent_fraction) * covariance_in_world(answer.covariance, heading).reshape(-1, POINTS, 3, 3).mean(
        axis=1
    )
    spread = _spread(after[inside], anew[inside])
    in_contact, spread[..., :3] = lines.take(stays).settled(spread[..., :3], window + 1)
    stays[stays] = in_contact
    return stays, spread[in_contact]


def _spread(points: Array, anew: Array) -> Array:
    """Points (n, 12, 6) of the Gaussian with the moments of these, the poses scattering anew by (n, 3, 3) besides."""
    mean, covariance = moments(points)
    covariance[:, :3, :3] += anew
    factor = np.linalg.cholesky(covariance + FLOOR * np.eye(6))
    return np.asarray(mean[:, None] + np.einsum("sj,nij->nsi", SIGMA, factor))


def moments(points: Array) -> tuple[Array, Array]:
    """Mean (n, k) and covariance (n, k, k) of points (n, 12, k) of equal weight."""
    mean = points.mean(axis=1)
    away = points - mean[:, None]
    return mean, np.asarray(np.swapaxes(away, 1, 2) @ away / points.shape[1])
