"""The windows of a validation one by one, as JSON: what was predicted, what was observed."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from push_predictor.evaluation.metrics import standardised
from push_predictor.evaluation.validation import Comparison
from push_predictor.recordings.windows import PushWindow


def write_window_log(path: Path, windows: Sequence[PushWindow], comparison: Comparison) -> None:
    """Write the log; an older file is replaced when the new one is complete."""
    temporary = path.with_name(f".{path.name}.part")
    temporary.write_text(json.dumps({"model": comparison.model, "windows": window_log(windows, comparison)}) + "\n")
    temporary.replace(path)


def window_log(windows: Sequence[PushWindow], comparison: Comparison) -> list[dict[str, object]]:
    """One entry a window, in the fields and units of PushResidual; stamps in ns."""
    z = standardised(comparison.mean, comparison.covariance, comparison.observed)
    return [
        {
            "push_id": window.push_id,
            "window": window.index,
            "start": window.start,
            "end": window.end,
            "velocity": window.velocity,
            "contact": window.contact,
            "angle": window.angle,
            "duration": window.duration,
            "predicted": comparison.mean[k].tolist(),
            "covariance": comparison.covariance[k].ravel().tolist(),
            "observed": comparison.observed[k].tolist(),
            "standardised": z[k].tolist(),
        }
        for k, window in enumerate(windows)
    ]
