"""Whether a model fits a recording, in one sentence: what the alarm says, and how many outcomes the intervals cover."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from push_predictor.recordings.table import OUTPUTS

LEVEL = 0.95  # of the intervals that are judged
CLEARLY = 3.0  # standard errors: a share of outcomes by which intervals count as too narrow or too wide


def judgement(metrics: Mapping[str, Any]) -> str:
    """The sentence for the JSON of `validate`, which has the alarm."""
    alarm, share, pushes = metrics["alarm"], covered(metrics), int(metrics["n_pushes"])
    covers = f"95 % intervals cover {100.0 * share:.0f} % of the outcomes of {pushes} pushes"
    if alarm["fired"]:
        return f"The model no longer fits: the alarm fired; {covers}."
    # Windows of one push resemble each other: the pushes count, not the windows.
    error = CLEARLY * np.sqrt(LEVEL * (1.0 - LEVEL) / pushes)
    also = "no alarm" if "off" not in alarm else "no alarm was computed"
    if share < LEVEL - error:
        return f"The model is too sure: {covers}; {also}."
    if metrics["nmse"]["total"] is not None and metrics["nmse"]["total"] >= len(OUTPUTS):
        return f"The model predicts no better than the mean of its training outcomes; {covers}; {also}."
    if "off" in alarm:
        return f"Nothing speaks against the model: {covers}; {also}."
    return f"The model fits: {covers}; {also}."


def covered(metrics: Mapping[str, Any]) -> float:
    """Share of the outcomes inside their intervals of LEVEL, the mean over the outputs."""
    return float(np.mean([metrics["coverage"][str(LEVEL)][name] for name in OUTPUTS]))
