"""A push of any length in windows as long as those that a model was trained on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from push_predictor.errors import RequestError
from push_predictor.models.push_model import PushModel

MOST_WINDOWS = 10_000


@dataclass(frozen=True)
class PushWindows:
    """Equal windows: count; duration (s) of each; asked (s), the duration for which the model is asked; scale, what its
    displacements are multiplied by.
    """

    count: int
    duration: float
    asked: float
    scale: float


def windows_of(model: PushModel, duration: float) -> PushWindows:
    """Cut a push of that duration (s). Raises RequestError where no number of windows suits the model.

    A learnt model answers for the windows that it has seen: its displacements are taken to grow in proportion within
    the tolerance that it has. The analytical model answers for any window; it is asked for those of its rows, because
    these have the scatter that it tells.
    """
    if not (np.isfinite(duration) and duration > 0.0):
        raise RequestError("duration", duration, "a finite number above 0, in s")
    usual = float(np.median(model.training.duration))
    if duration > MOST_WINDOWS * usual:
        raise RequestError("duration", duration, f"at most {MOST_WINDOWS * usual:g} s, {MOST_WINDOWS} windows")
    if not model.predictor.learnt:
        count = max(1, round(duration / usual))
        return PushWindows(count, duration / count, duration / count, 1.0)
    low, high = model.duration_range
    fewest, most = int(np.ceil(duration / high * (1.0 - 1e-12))), int(duration / low * (1.0 + 1e-12))
    if fewest > most:
        raise RequestError("duration", duration, f"{low:.3g} to {high:.3g} s, or a number of windows as long as that")
    count = min(max(round(duration / usual), fewest), most)
    return PushWindows(count, duration / count, usual, duration / count / usual)
