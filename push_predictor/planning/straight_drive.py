# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A tip that moves in a straight line in the world: its start for a push, and its later contacts with the slider.

A sampled displacement need not leave the outline at the tip. If there is a gap, the tip closes it first and pushes for
the rest of the window only. If the tip is inside the outline, it pushes for longer than the window. A slider that the
tip passes is not pushed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from push_predictor.geometry.frames import rotate, to_body, to_world, wrap_angle
from push_predictor.geometry.outline import Outline
from push_predictor.geometry.touch import Touch, touches
from push_predictor.types import Array, BoolArray

MAX_SHARE = 2.0  # a tip inside the outline pushes for at most this many windows in one
TOLERANCE = 0.1  # of the tip's radius: error of the distance that counts as contact


@dataclass(frozen=True, eq=False)
class TipContact:
    """Contact of p tips with p sliders in a window.

    share (p,): fraction of the tip's path in the window during which it pushes; in_contact (p,): whether it pushes at
    all. Where it does not, share is 0 and touch is undefined.
    """

    touch: Touch
    share: Array
    in_contact: BoolArray


@dataclass(frozen=True, eq=False)
class StraightDrive:
    """Tips that start at (p, 2) m in the world and move at velocities (p, 2) m/s."""

    outline: Outline
    radius: float
    start: Array
    velocities: Array

    def contact_at(self, sliders: Array, before: TipContact, time: float, window: float) -> TipContact:
        """Contacts of the tips with sliders (p, 3) in a window (s) that begins `time` s after the start.

        before: the contact in the previous window; at a vertex a contact belongs to the edge that it slid along.
        """
        tips, path = self.start + time * self.velocities, window * np.hypot(*self.velocities.T)
        nearest = self.outline.project(to_body(tips, sliders))
        ahead = self.velocities / np.hypot(*self.velocities.T)[:, None]
        # Approach speed of the tip; at a vertex the normal points to the tip, not along that of an edge.
        closing = -np.sum(rotate(nearest.normal, sliders[:, 2]) * ahead, axis=1)
        until = (nearest.distance - self.radius) / np.maximum(closing, np.finfo(float).tiny)
        until = np.clip(until, (1.0 - MAX_SHARE) * path, path)
        touch = self._touch(sliders, tips + until[:, None] * ahead, before.touch)
        in_contact = (closing > 0.0) & (until < path) & (np.abs(touch.inputs[:, 2]) < np.pi / 2.0)
        in_contact &= touch.distance - self.radius <= TOLERANCE * self.radius
        return TipContact(touch, np.where(in_contact, 1.0 - until / path, 0.0), in_contact)

    def _touch(self, sliders: Array, tips: Array, before: Touch) -> Touch:
        touch = touches(self.outline, sliders, tips, self.velocities)
        nearest, slid_along = self.outline.project(to_body(tips, sliders)), self.outline.edge(before.inputs[:, 1])[0]
        if not nearest.at_vertex.any():
            return touch
        vertices = self.outline.vertices
        vertex = np.argmin(np.linalg.norm(vertices - nearest.point[:, None], axis=2), axis=1)
        ends_there = nearest.at_vertex & (slid_along == (vertex - 1) % len(vertices))
        begins_there = nearest.at_vertex & (slid_along == vertex)
        contact = np.where(begins_there, self.outline.contact_on_edge(slid_along, 0.0), touch.inputs[:, 1])
        contact = np.where(ends_there, self.outline.contact_on_edge(slid_along, 1.0), contact)
        inward = self.outline.inward_normal(contact)
        angle = wrap_angle(touch.heading - sliders[:, 2] - np.arctan2(inward[:, 1], inward[:, 0]))
        return replace(touch, inputs=np.column_stack([touch.inputs[:, 0], contact, angle]))


def start_drive(outline: Outline, radius: float, sliders: Array, inputs: Array) -> tuple[StraightDrive, TipContact]:
    """Start tips of that radius (m) at sliders (p, 3); return them with their contacts in the first window.

    inputs (p, 3): velocity m/s, contact, angle rad.
    """
    velocity, contact, angle = inputs.T
    inward = outline.inward_normal(contact)
    start = to_world(outline.point(contact) - radius * inward, sliders)
    velocities = rotate(velocity[:, None] * rotate(inward, angle), sliders[:, 2])
    heading = np.arctan2(velocities[:, 1], velocities[:, 0])
    touch = Touch(inputs, heading, np.full(len(inputs), radius))
    everyone = np.ones(len(inputs), dtype=np.bool_)
    return StraightDrive(outline, radius, start, velocities), TipContact(touch, np.ones(len(inputs)), everyone)
