# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The windows of a validation one by one, as JSON: predicted, observed, refused."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from push_predictor.evaluation.metrics import standardised
from push_predictor.evaluation.validation import Comparison
from push_predictor.recordings.atomic import write_whole
from push_predictor.recordings.windows.push_window import PushWindow


@dataclass(frozen=True)
class Refusal:
    """A window that the server refused to predict, and its reason."""

    push_id: str
    window: int
    reason: str


def write_window_log(
    path: Path,
    windows: Sequence[PushWindow],
    comparison: Comparison,
    refused: Sequence[Refusal] = (),
    unanswered: int = 0,
) -> None:
    """Write {"model", "windows", "refused", "unanswered"}; an older file is replaced when the new one is complete.

    windows: one for each row of the comparison. refused: further windows. unanswered: how many more there were.
    Raises OSError that names the path.
    """
    write_whole(path, (line.encode() for line in _lines(windows, comparison, refused, unanswered)))


def _lines(
    windows: Sequence[PushWindow], comparison: Comparison, refused: Sequence[Refusal], unanswered: int
) -> Iterator[str]:
    """The text entry by entry: as one string a day's windows would take a gigabyte."""
    yield f'{{"model": {json.dumps(comparison.model)}, "windows": ['
    for k, entry in enumerate(window_log(windows, comparison)):
        yield ("," if k else "") + "\n" + json.dumps(entry, allow_nan=False)
    rest = json.dumps([asdict(refusal) for refusal in refused])
    yield f'],\n"refused": {rest}, "unanswered": {unanswered}}}\n'


def window_log(windows: Sequence[PushWindow], comparison: Comparison) -> Iterator[dict[str, object]]:
    """One entry for each window, in the fields and units of PushResidual; stamps in ns."""
    z = standardised(comparison.mean, comparison.covariance, comparison.observed)
    for k, window in enumerate(windows):
        yield {
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
