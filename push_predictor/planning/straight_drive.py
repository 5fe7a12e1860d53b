"""A tip that drives straight on in the world: where it is put for a push, and where it meets a slider later on.

A sampled displacement need not leave the outline at the tip. Where it stands off, the tip has to come up first and
pushes over the rest of the window only; where the tip reaches in, the slider lags behind and is pushed further. A
slider that the tip passes by is not pushed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from push_predictor.geometry.frames import rotate, to_body, to_world, wrap_angle
from push_predictor.geometry.outline import Outline
from push_predictor.geometry.touch import Touch, touches
from push_predictor.types import Array, BoolArray

FARTHEST = 2.0  # windows that a tip which reaches in may push in one
AMISS = 0.1  # of the tip's radius: how far off it may be where it is taken to touch


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
    """Tips that start at (p, 2) m in the world and drive at velocities (p, 2) m/s."""

    outline: Outline
    radius: float
    start: Array
    velocities: Array

    def meet(self, sliders: Array, before: TipContact, time: float, window: float) -> TipContact:
        """How the tips push sliders (p, 3) in a window (s) that begins `time` s after the start.

        before: the contact in the previous window; at a vertex a contact belongs to the edge that it slid along.
        """
        tips, way = self.start + time * self.velocities, window * np.hypot(*self.velocities.T)
        nearest = self.outline.project(to_body(tips, sliders))
        ahead = self.velocities / np.hypot(*self.velocities.T)[:, None]
        # How fast the tip comes nearer; at a vertex the normal is the one of the tip, not of an edge.
        closing = -np.sum(rotate(nearest.normal, sliders[:, 2]) * ahead, axis=1)
        until = (nearest.distance - self.radius) / np.maximum(closing, np.finfo(float).tiny)
        until = np.clip(until, (1.0 - FARTHEST) * way, way)
        touch = self._touch(sliders, tips + until[:, None] * ahead, before.touch)
        in_contact = (closing > 0.0) & (until < way) & (np.abs(touch.inputs[:, 2]) < np.pi / 2.0)
        in_contact &= touch.distance - self.radius <= AMISS * self.radius
        return TipContact(touch, np.where(in_contact, 1.0 - until / way, 0.0), in_contact)

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
    """Put tips of that radius (m) at sliders (p, 3), each at contact and angle of its inputs (p, 3: velocity m/s,
    contact, angle rad); with the contact in the first window.
    """
    velocity, contact, angle = inputs.T
    inward = outline.inward_normal(contact)
    start = to_world(outline.point(contact) - radius * inward, sliders)
    velocities = rotate(velocity[:, None] * rotate(inward, angle), sliders[:, 2])
    heading = np.arctan2(velocities[:, 1], velocities[:, 0])
    touch = Touch(inputs, heading, np.full(len(inputs), radius))
    everyone = np.ones(len(inputs), dtype=np.bool_)
    return StraightDrive(outline, radius, start, velocities), TipContact(touch, np.ones(len(inputs)), everyone)
