# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The folder that a validator writes: result, residuals and report."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from push_predictor.errors import PushPredictorError, RequestError
from push_predictor.nodes.runtime import one_line
from push_predictor.nodes.validator.validation_run import ValidationRun
from push_predictor.online.child_process import Child
from push_predictor.online.live_validation import write_report


class ResultWriter:
    """Writes runs to the folder `output`, none if that is empty. Raises RequestError if it cannot be made."""

    def __init__(self, output: str, log: Any) -> None:
        self.folder = _folder(output)
        self.report = Child("report", write_report)
        self._log = log
        self._has_result = False

    def write(self, run: ValidationRun, with_report: bool) -> str:
        """Write a run that has ended; returns why that failed, empty if it did not."""
        self._warn_of_missing(run)
        windows = len(run.validation.windows)
        if self.folder is None or (self._has_result and not windows):
            return ""  # samples without a push are no reason to replace an earlier result
        try:
            written = run.write(self.folder)
        except (PushPredictorError, OSError) as error:
            failure = f"The result could not be written: {one_line(error)}"
            self._log.error(failure)
            return failure
        self._has_result = True
        self._log.info(f"Validation written: {', '.join(map(str, written))}")
        if not len(run.validation.predicted()):
            self._log.warning(f"The result has no score: {windows} windows were found, and none was predicted.")
        if with_report and len(run.validation.predicted()):
            alarm = None if run.alarm is None else run.alarm.json
            self.report.start(*run.validation.reported(), self.folder, alarm)
            self._log.info(f"Writing the report {self.folder / 'report.html'}, which takes some seconds.")
        return ""

    def close(self) -> None:
        """End a report that is being written."""
        if self.report.alive:
            self._log.warning("The report was interrupted. `push_predictor report validation` writes one.")
        self.report.stop()

    def warn_of_interrupted(self, run: ValidationRun) -> None:
        """Log once where an earlier run was moved that had not come to its end."""
        if run.table is None or (saved := run.table.cut_off) is None:
            return
        run.table.cut_off = None
        self._log.warning(
            f"An earlier validation was interrupted. Its windows and residuals are saved in {saved}. "
            "It has no validation.json, windows.json, bag of residuals or report."
        )

    def _warn_of_missing(self, run: ValidationRun) -> None:
        for k, name in enumerate(run.validation.names):
            if missing := run.validation.unanswered(k):
                self._log.warning(f"{name}: predict_push never answered for {missing} windows. They are not scored.")


def _folder(text: str) -> Path | None:
    """Create the output folder before the run, so that a folder that cannot be written is reported at once."""
    if not text:
        return None
    folder = Path(text).expanduser().absolute()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RequestError("output", text, f"a folder that can be written ({error.strerror})") from None
    return folder
