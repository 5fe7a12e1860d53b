# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Mirrored or exchanged axes of the slider's poses, each undone in the contacts."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from push_predictor.geometry.frames import rotate, to_body, to_world
from push_predictor.recordings.checks.outline.touches import Contacts

RIGHT_HANDED = "Use right-handed frames, seen from above."
IN_ORDER = "Give x before y, in right-handed frames seen from above."


@dataclass(frozen=True)
class Mirror:
    """What undoes the mistake: rows that multiply the slider's x and y, and the sign of its heading.

    A constant turn of the heading is part of the fitted yaw.
    """

    x: tuple[float, float]
    y: tuple[float, float]
    heading: float
    mistake: str
    advice: str


def _sign(what: str) -> str:
    return f"The sign of the slider's {what} is wrong."


# The first of those that fit equally well is named.
MIRRORS = {
    "heading_clockwise": Mirror(
        (1.0, 0.0), (0.0, 1.0), -1.0, _sign("heading"), "Negate the heading: counter-clockwise is positive."
    ),
    "frame_mirrored": Mirror((1.0, 0.0), (0.0, -1.0), -1.0, _sign("y axis and heading"), RIGHT_HANDED),
    "frame_mirrored_x": Mirror((-1.0, 0.0), (0.0, 1.0), -1.0, _sign("x axis and heading"), RIGHT_HANDED),
    "axes_exchanged": Mirror(
        (0.0, 1.0), (1.0, 0.0), -1.0, "The slider's x and y axes are exchanged, its heading too.", IN_ORDER
    ),
    "y_mirrored": Mirror((1.0, 0.0), (0.0, -1.0), 1.0, _sign("y axis"), RIGHT_HANDED),
    "x_mirrored": Mirror((-1.0, 0.0), (0.0, 1.0), 1.0, _sign("x axis"), RIGHT_HANDED),
    "xy_exchanged": Mirror(
        (0.0, 1.0), (1.0, 0.0), 1.0, "The slider's x and y positions are exchanged, its heading is not.", IN_ORDER
    ),
}


def reflected(contacts: Contacts, mirror: Mirror) -> Contacts:
    """The contacts with the slider's poses corrected; the same samples are in contact."""
    world, velocities = to_world(contacts.tips, contacts.poses), rotate(contacts.velocities, contacts.poses[:, 2])
    places = contacts.poses[:, :2] @ np.array([mirror.x, mirror.y]).T
    poses = np.column_stack([places, mirror.heading * contacts.poses[:, 2]])
    return replace(contacts, tips=to_body(world, poses), velocities=rotate(velocities, -poses[:, 2]), poses=poses)
