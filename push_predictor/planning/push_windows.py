# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""Divide a push of any duration into windows of the duration that a model was trained on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.errors import RequestError, TooLargeError
from push_predictor.models.push_model import PushModel

MOST_WINDOWS = 10_000


@dataclass(frozen=True)
class PushWindows:
    """Equal windows of a push.

    duration (s): of each window; asked (s): the duration passed to the model; scale: factor on its displacements.
    """

    count: int
    duration: float
    asked: float
    scale: float


def windows_of(model: PushModel, duration: float) -> PushWindows:
    """Divide a push of that duration (s) into windows. Raises RequestError if no number of windows suits the model.

    A learnt model predicts its training duration; displacements are scaled in proportion within its tolerance. The
    analytical model predicts any duration; it gets windows of about its training duration, to which its covariance
    applies.
    """
    if not (np.isfinite(duration) and duration > 0.0):
        raise RequestError("duration", duration, "a finite number above 0, in s")
    usual = model.usual_duration
    if duration > MOST_WINDOWS * usual:
        raise TooLargeError("duration", duration, f"at most {MOST_WINDOWS * usual:g} s, {MOST_WINDOWS} windows")
    if not model.predictor.learnt:
        count = max(1, round(duration / usual))
        return PushWindows(count, duration / count, duration / count, 1.0)
    low, high = model.duration_range
    fewest, most = int(np.ceil(duration / high * (1.0 - 1e-12))), int(duration / low * (1.0 + 1e-12))
    if fewest > most:
        raise RequestError("duration", duration, f"{low:.3g} to {high:.3g} s, or a multiple of such a duration")
    count = min(max(round(duration / usual), fewest), most)
    return PushWindows(count, duration / count, usual, duration / count / usual)
