# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The HTML report of a validation, written by a process of its own: figures take seconds while samples arrive."""

from __future__ import annotations

import signal
import sys
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from push_predictor.errors import PushPredictorError
from push_predictor.evaluation.offline import report_windows
from push_predictor.evaluation.validation import Comparison
from push_predictor.models.push_model import PushModel
from push_predictor.online.child_process import Child
from push_predictor.online.live_validation import LiveValidation, WindowRows


class ReportWriter:
    """Writes one report at a time."""

    def __init__(self) -> None:
        self._child: Child | None = None

    @property
    def busy(self) -> bool:
        """Whether a report is being written."""
        return self._child is not None and self._child.process.is_alive()

    @property
    def failed(self) -> bool:
        """Whether the last report failed."""
        return self._child is not None and self._child.process.exitcode not in (None, 0)

    def start(self, validation: LiveValidation, folder: Path, alarm: Mapping[str, object] | None = None) -> None:
        """Write FOLDER/report.html about the models that have predicted the same windows as the main one.

        alarm: of the main model, as in validation.json.
        """
        self.stop()
        comparisons = [validation.comparison(k) for k in range(len(validation.models))]
        whole = [k for k, c in enumerate(comparisons) if np.array_equal(c.observed, comparisons[0].observed)]
        models, shown = [validation.models[k] for k in whole], [comparisons[k] for k in whole]
        self._child = Child("report", _write, models, validation.predicted(), shown, folder, alarm)

    def stop(self) -> None:
        """End a report that is being written; its unfinished files are removed."""
        if self._child is not None:
            self._child.stop()


def _write(
    pipe: object,
    models: list[PushModel],
    windows: WindowRows,
    comparisons: list[Comparison],
    folder: Path,
    alarm: Mapping[str, object] | None,
) -> None:
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))  # so that unfinished files are removed
    try:
        report_windows(models, windows, comparisons, folder, "online validation", alarm=alarm)
    except (PushPredictorError, OSError) as error:
        sys.exit(f"report: {' '.join(str(error).split())}")
