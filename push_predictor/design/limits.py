# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What a robot can do: the limits of the pushes to choose from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.errors import RequestError
from push_predictor.models.push_model import PushModel
from push_predictor.models.request import FARTHEST
from push_predictor.types import Array, BoolArray

USUAL_TRAVEL = 0.03  # m
WIDEST = 1.0  # rad, where the model's pushes do not reach farther
LONGEST = 600.0  # s, of a push
MOST_EXCLUDED = 0.99  # of the perimeter; with less left, candidates are hard to find

Interval = tuple[float, float]


@dataclass(frozen=True)
class Limits:
    """Pushes that a robot can make. Raises RequestError for a value that is not accepted.

    speed: lowest and highest, m/s; None for those of the model's training pushes. angle: smallest and largest push
    angle, rad; None for ±1 or the training pushes' range where that is wider. travel: length of a push, m. excluded:
    intervals of the contact, as fractions of the perimeter, that are not pushed; one that begins above its end passes
    the first vertex. transfer_speed: of the tip around the outline between two pushes, m/s. With it, pushes are chosen
    by what they would show per second; without it, time is free.
    """

    speed: Interval | None = None
    angle: Interval | None = None
    travel: float = USUAL_TRAVEL
    excluded: tuple[Interval, ...] = ()
    transfer_speed: float | None = None

    def __post_init__(self) -> None:
        if self.speed is not None and not 0.0 < self.speed[0] <= self.speed[1] < np.inf:
            raise RequestError("speed", self.speed, "lowest and highest speed, above 0, in m/s")
        if self.angle is not None and not -np.pi / 2.0 < self.angle[0] <= self.angle[1] < np.pi / 2.0:
            raise RequestError("angle", self.angle, "smallest and largest angle, in (-pi/2, pi/2), in rad")
        if not 0.0 < self.travel <= FARTHEST:
            raise RequestError("travel", self.travel, f"a number above 0 and up to {FARTHEST:g}, in m")
        if self.transfer_speed is not None and not 0.0 < self.transfer_speed < np.inf:
            raise RequestError("transfer_speed", self.transfer_speed, "a finite number above 0, in m/s")
        if self.speed is not None and self.travel / self.speed[0] > LONGEST:
            least = f"at least {self.travel / LONGEST:.3g} m/s: a push lasts at most {LONGEST:g} s"
            raise RequestError("speed", self.speed, least)
        for interval in self.excluded:
            if not all(0.0 <= end <= 1.0 for end in interval):
                raise RequestError("excluded", interval, "two fractions of the perimeter, from 0 to 1")
        if np.mean(self.allows(np.linspace(0.0, 1.0, 1000, endpoint=False))) < 1.0 - MOST_EXCLUDED:
            raise RequestError("excluded", self.excluded, "intervals that leave a part of the outline to push")

    def allows(self, contact: Array) -> BoolArray:
        """Whether contacts (n,) lie outside the excluded intervals, (n,)."""
        allowed = np.ones(len(contact), dtype=np.bool_)
        for begin, end in self.excluded:
            after, before = contact >= begin, contact <= end
            allowed &= ~(after & before if begin <= end else after | before)
        return allowed

    def ranges(self, model: PushModel) -> tuple[Interval, Interval]:
        """The range of the speed, m/s, and of the angle, rad, of pushes for a model.

        Raises RequestError for a speed that the model cannot predict.
        """
        known = model.training.inputs
        speed, angle = (model.usual_speed, model.usual_speed), (-WIDEST, WIDEST)
        if len(known):
            speed = float(known[:, 0].min()), float(known[:, 0].max())
            angle = min(-WIDEST, float(known[:, 2].min())), max(WIDEST, float(known[:, 2].max()))
        if self.speed is not None and self.speed[1] * model.usual_duration > FARTHEST:
            most, window = FARTHEST / model.usual_duration, f"{model.usual_duration:g} s"
            raise RequestError("speed", self.speed, f"at most {most:.3g} m/s: {FARTHEST:g} m in a window of {window}")
        return self.speed or speed, self.angle or angle
