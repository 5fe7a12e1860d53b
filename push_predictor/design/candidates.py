# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Pushes to choose from, spread evenly over what the robot can do, and the windows that they last."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.design.limits import Limits
from push_predictor.errors import RequestError
from push_predictor.geometry.touch import displaced
from push_predictor.models.push_model import PushModel
from push_predictor.models.pushes import Push
from push_predictor.planning.straight_drive import start_drive
from push_predictor.types import Array, BoolArray

MOST_WINDOWS = 16  # of a push; what later ones of a longer push would show is not counted
MOST_DRAWN = 2**17  # points of the sequence; with less than 1 % of the outline left, candidates are not found


@dataclass(frozen=True, eq=False)
class Courses:
    """Windows of c straight pushes, at most w each.

    inputs (c, w, 3) at the start of each window; kept (c, w): whether the push has that window; duration: of a window,
    s.
    """

    inputs: Array
    kept: BoolArray
    duration: float

    @property
    def windows(self) -> Push:
        """All windows (c * w), those that a push does not have as a copy of its first, without covariates."""
        inputs = np.where(self.kept[:, :, None], self.inputs, self.inputs[:, :1]).reshape(-1, 3)
        return Push(inputs, np.full(len(inputs), self.duration), {})

    @property
    def distance(self) -> Array:
        """Distance (c, w, w) in m along the tip's path between the windows of each push."""
        place = np.arange(self.inputs.shape[1]) * self.duration
        return np.asarray(self.inputs[:, :1, 0, None] * np.abs(place[:, None] - place))


def candidate_pushes(model: PushModel, limits: Limits, count: int, seed: int = 0) -> Array:
    """Inputs (count, 3) of pushes that a robot can make: a scrambled Sobol' sequence over the limits.

    Raises RequestError for limits that leave hardly anything of the outline.
    """
    from scipy.stats import qmc  # its import would take every node 0.4 s at the start

    sequence = qmc.Sobol(3, scramble=True, seed=seed)
    low, high = np.array([[*pair] for pair in (limits.ranges(model)[0], (0.0, 1.0), limits.ranges(model)[1])]).T
    size, found = 2 ** int(np.ceil(np.log2(count))), np.empty((0, 3))
    while len(found) < count:
        if sequence.num_generated >= MOST_DRAWN:
            raise RequestError("excluded", limits.excluded, "intervals that leave more of the outline to push")
        drawn = low + (high - low) * sequence.random(size)
        found = np.concatenate([found, drawn[limits.allows(drawn[:, 1])]])
    found[:, 1] = np.minimum(found[:, 1], np.nextafter(1.0, 0.0))
    return np.asarray(found[:count])


def courses(model: PushModel, inputs: Array, travel: float) -> Courses:
    """The windows of straight pushes of a length in m that begin with inputs (c, 3).

    The slider moves as the model's mechanics predict. A push ends where the tip leaves the slider.
    """
    duration = model.usual_duration
    counts = np.maximum(np.floor(travel / (inputs[:, 0] * duration) * (1.0 + 1e-9)), 1).astype(np.int64)
    poses = np.zeros((len(inputs), 3))
    drive, contact = start_drive(model.rig.outline, model.rig.pusher_radius, poses, inputs)
    at, kept = [inputs], [np.ones(len(inputs), dtype=np.bool_)]
    for window in range(1, min(int(counts.max()), MOST_WINDOWS)):
        poses = _moved(model, poses, contact.touch.inputs, contact.touch.heading, duration)
        contact = drive.contact_at(poses, contact, window * duration, duration)
        kept.append(kept[-1] & contact.in_contact & (window < counts))
        # Pushes that have ended go on as they began, so that the mechanics get inputs that they accept.
        contact.touch.inputs[~kept[-1]] = inputs[~kept[-1]]
        at.append(contact.touch.inputs)
    return Courses(np.stack(at, axis=1), np.stack(kept, axis=1), duration)


def _moved(model: PushModel, poses: Array, inputs: Array, heading: Array, duration: float) -> Array:
    """Poses (c, 3) of sliders after a window."""
    of_window = model.predictor.mechanics.mechanics.displacement(
        model.predictor.mechanics.values, inputs, np.full(len(inputs), duration)
    )
    return displaced(poses, heading, of_window)
