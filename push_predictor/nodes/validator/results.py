# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""What a validator publishes of each window, and what it writes at the end of a run."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from rclpy.node import Node
from visualization_msgs.msg import MarkerArray

from msg_adapters.markers import window_markers
from msg_adapters.residuals import alarm_to_message
from push_predictor.errors import PushPredictorError, RequestError
from push_predictor.evaluation.alarm.evidence import AlarmState, alarm_json, alarm_sentence
from push_predictor.models.prediction import Prediction
from push_predictor.nodes.qos import LATCHED
from push_predictor.nodes.runtime import one_line
from push_predictor.nodes.validator.validation_run import ValidationRun
from push_predictor.online.child_process import Child
from push_predictor.online.live_validation import write_report
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.windows.push_window import PushWindow
from push_predictor_interfaces.msg import PushAlarm, PushResidual


class ResultPublishers:
    """Publishers of push_residual, push_alarm and push_markers. world: returns the frame in which the poses are."""

    def __init__(self, node: Node, world: Callable[[], str]) -> None:
        self._log, self._world = node.get_logger(), world
        self._residuals = node.create_publisher(PushResidual, "push_residual", 1000)
        self._alarms = node.create_publisher(PushAlarm, "push_alarm", LATCHED)
        self._markers = node.create_publisher(MarkerArray, "push_markers", 100)  # for a burst after a stall

    def publish(self, rig: Rig, model: int, window: PushWindow, prediction: Prediction, residual: PushResidual) -> None:
        """Publish the residual of a window; markers only of the main model, 0, and while somebody subscribes."""
        self._residuals.publish(residual)
        if model == 0 and self._markers.get_subscription_count():
            self._markers.publish(window_markers(rig, window, prediction, self._world()))

    def alarm(self, model: str, state: AlarmState, end: int) -> None:
        """Log and publish an alarm about a model that has fired; end: of the push at which it fired, ns."""
        self._log.warning(alarm_sentence(alarm_json(state)))
        self._alarms.publish(alarm_to_message(state, model, end, self._world()))


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
        if run.files is None or (saved := run.files.cut_off) is None:
            return
        run.files.cut_off = None
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
