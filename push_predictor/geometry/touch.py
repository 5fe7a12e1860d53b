"""A pusher at a slider: where it touches and how it pushes, and where a displacement in the push frame leads."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.geometry.frames import rotate, to_body
from push_predictor.geometry.outline import Outline
from push_predictor.types import Array


@dataclass(frozen=True, eq=False)
class Touch:
    """n pushers at n sliders: inputs (n, 3: velocity m/s, contact, angle rad in [-pi, pi)), heading (n,) of the push in
    the world, rad; distance (n,) of the tip's centre from the outline, m, negative inside.

    Only an angle within +-pi/2 is a push.
    """

    inputs: Array
    heading: Array
    distance: Array


def touches(outline: Outline, sliders: Array, tips: Array, velocities: Array) -> Touch:
    """Tips at (n, 2) m that drive with velocities (n, 2) m/s at sliders (n, 3: x, y m, heading rad), in one frame."""
    nearest = outline.project(to_body(tips, sliders))
    inward = rotate(outline.inward_normal(nearest.contact), sliders[:, 2])
    across = inward[:, 0] * velocities[:, 1] - inward[:, 1] * velocities[:, 0]
    angle = np.arctan2(across, np.sum(inward * velocities, axis=1))
    speed = np.hypot(velocities[:, 0], velocities[:, 1])
    heading = np.arctan2(velocities[:, 1], velocities[:, 0])
    return Touch(np.column_stack([speed, nearest.contact, angle]), heading, nearest.distance)


def displaced(sliders: Array, heading: Array, displacement: Array) -> Array:
    """Sliders (n, 3) after displacements (n, 3: dx, dy, dtheta in the frame of pushes with headings (n,))."""
    return sliders + np.column_stack([rotate(displacement[:, :2], heading), displacement[:, 2]])


def covariance_in_world(covariance: Array, heading: Array) -> Array:
    """Covariances (n, 3, 3) of displacements, along the world's axes instead of those of the push frame."""
    turn = np.zeros((len(heading), 3, 3))
    turn[:, :2, :2] = np.swapaxes(rotate(np.eye(2), heading[:, None]), 1, 2)
    turn[:, 2, 2] = 1.0
    return np.asarray(turn @ covariance @ np.swapaxes(turn, 1, 2))
