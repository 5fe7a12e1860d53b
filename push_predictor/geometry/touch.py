# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Pushes from poses: contact, angle and velocity of a pusher at a slider, and poses after a push."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.geometry.frames import rotate, to_body
from push_predictor.geometry.outline import Outline, Projection
from push_predictor.types import Array


@dataclass(frozen=True, eq=False)
class Touch:
    """n pushers at n sliders.

    inputs (n, 3: velocity m/s, contact, angle rad in [-pi, pi)); heading (n,) of the push in the world, rad; distance
    (n,) of the tip's centre from the outline, m, negative inside. Only an angle within +-pi/2 is a push.
    """

    inputs: Array
    heading: Array
    distance: Array


def touches(outline: Outline, sliders: Array, tips: Array, velocities: Array) -> Touch:
    """The pushes of tips at sliders, in one frame.

    sliders (n, 3: x, y m, heading rad); tips (n, 2) m; velocities (n, 2) m/s of the tips. A tip at a corner touches the
    edge that faces it more directly, as in a window, unless it pushes only the other one.
    """
    nearest = outline.project(to_body(tips, sliders))
    ahead = rotate(velocities, -sliders[:, 2])
    contact = nearest.contact
    if nearest.at_vertex.any():
        contact = contact.copy()
        contact[nearest.at_vertex] = _at_corners(outline, nearest, ahead)
    speed = np.hypot(velocities[:, 0], velocities[:, 1])
    heading = np.arctan2(velocities[:, 1], velocities[:, 0])
    angle = _angle(outline.inward_normal(contact), ahead)
    return Touch(np.column_stack([speed, contact, angle]), heading, nearest.distance)


def displaced(sliders: Array, heading: Array, displacement: Array) -> Array:
    """Slider poses (n, 3) after displacements (n, 3: dx, dy, dtheta) in push frames with headings (n,)."""
    return sliders + np.column_stack([rotate(displacement[:, :2], heading), displacement[:, 2]])


def covariance_in_world(covariance: Array, heading: Array) -> Array:
    """Covariances (n, 3, 3) of displacements, transformed from the push frame to the world's axes."""
    turn = np.zeros((len(heading), 3, 3))
    turn[:, :2, :2] = np.swapaxes(rotate(np.eye(2), heading[:, None]), 1, 2)
    turn[:, 2, 2] = 1.0
    return np.asarray(turn @ covariance @ np.swapaxes(turn, 1, 2))


def _angle(inward: Array, ahead: Array) -> Array:
    """From inward normals (..., 2) to directions (..., 2), rad."""
    across = inward[..., 0] * ahead[..., 1] - inward[..., 1] * ahead[..., 0]
    return np.asarray(np.arctan2(across, np.sum(inward * ahead, axis=-1)))


def _at_corners(outline: Outline, nearest: Projection, ahead: Array) -> Array:
    """The contacts (k,) of the k tips at a corner; ahead (n, 2): velocities of all n tips in the body frame."""
    edge, share = outline.edge(nearest.contact[nearest.at_vertex])
    vertex = edge + (share > 0.5)
    sides = np.stack([vertex - 1, vertex], axis=1) % len(outline.vertices)
    contacts = outline.contact_on_edge(sides, np.array([1.0, 0.0]))
    inward = outline.inward_normal(contacts.ravel()).reshape(-1, 2, 2)
    pushed = np.abs(_angle(inward, ahead[nearest.at_vertex, None])) < np.pi / 2.0
    rows = np.arange(len(contacts))
    first = np.argmax(np.einsum("kej,kj->ke", inward, -nearest.normal[nearest.at_vertex]), axis=1)
    chosen = np.where(pushed[rows, 1 - first] & ~pushed[rows, first], 1 - first, first)
    return np.asarray(contacts[rows, chosen])
