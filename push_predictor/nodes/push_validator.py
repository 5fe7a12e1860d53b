"""The node that compares prediction and outcome while pushes happen, or are replayed (docs/validation.md)."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, WrenchStamped
from push_predictor_interfaces.msg import PushResidual
from push_predictor_interfaces.srv import PredictPush
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.subscription import Subscription
from std_msgs.msg import String
from std_srvs.srv import Trigger
from visualization_msgs.msg import MarkerArray

from msg_adapters.diagnostics import Level, diagnostic_array, diagnostic_status
from msg_adapters.markers import prediction_markers
from msg_adapters.poses import pose_from_message, wrench_from_message
from msg_adapters.predictions import RefusedError, prediction_from_response, query_to_request
from msg_adapters.residuals import ValidatedWindow, residual_to_message
from msg_adapters.streams import Inbox, pose_stream, wrench_stream
from push_predictor.errors import PushPredictorError, RigError
from push_predictor.evaluation.live_validation import LiveValidation
from push_predictor.evaluation.offline import window_options
from push_predictor.evaluation.validation import metrics_json
from push_predictor.geometry.frames import rotate
from push_predictor.models.push_model import Prediction
from push_predictor.nodes.model_source import ModelSource
from push_predictor.nodes.parameters import Param, declare, values_of
from push_predictor.nodes.prediction_client import PredictionClient
from push_predictor.nodes.residual_recorder import ResidualRecorder
from push_predictor.nodes.runtime import Stop, run
from push_predictor.recordings.rig import Rig, load_rig, rig_from_json
from push_predictor.recordings.window_finder import WindowFinder
from push_predictor.recordings.windows import PushWindow

PERIOD = 0.02  # s between two looks into the inboxes
QUIET = 0.3  # s without samples after which a finished replay has delivered all it will
LAST_ANSWERS = 5.0  # s that open requests are waited for when the end has come
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
PARAMETERS = (
    Param("model", "", "The model judged: a model file, or a name that predict_server knows; empty: its default."),
    Param("compare", [""], "Further models judged on the same windows: files or names."),
    Param("rig", "", "A push_rig record (YAML file); empty: what the topic `rig` says."),
    Param("output", "", "Folder for validation.json, windows.json, the recording of residuals and the report."),
    Param("report", True, "Write the HTML report too when a recording has finished."),
    Param("request_timeout", 2.0, "Seconds after which an unanswered request is sent again.", low=0.05, high=60.0),
    Param("diagnostics_period", 1.0, "Seconds between two messages on /diagnostics.", low=0.1, high=60.0),
)


class PushValidator(Node):
    """Finds windows in the sensor topics, asks predict_push about each, and keeps the score."""

    def __init__(self) -> None:
        super().__init__("push_validator")
        declare(self, PARAMETERS)
        self._values = values_of(self, PARAMETERS)
        self._source = ModelSource(self, [self._values["model"], *self._values["compare"]])
        self._rig: Rig | None = load_rig(Path(self._values["rig"])) if self._values["rig"] else None
        self._client = PredictionClient(self, self._values["request_timeout"])
        self._recorder = ResidualRecorder(Path(self._values["output"])) if self._values["output"] else None
        self._finder: WindowFinder | None = None
        self._session: LiveValidation | None = None
        self._refused = 0
        self._reason = ""
        self._finished = False  # the replay said so
        self._written = True  # nothing to write yet
        self._last_sample = monotonic()
        self._listen()
        self._speak()

    def _listen(self) -> None:
        self._slider: Inbox[Any] = Inbox(pose_from_message)
        self._pusher: Inbox[Any] = Inbox(pose_from_message)
        self._wrench: Inbox[Any] = Inbox(wrench_from_message)
        self._sensors = [
            self._sensor(PoseStamped, "slider/pose", self._slider),
            self._sensor(PoseStamped, "pusher/pose", self._pusher),
            self._sensor(WrenchStamped, "pusher/wrench", self._wrench),
        ]
        self.create_subscription(String, "rig", self._on_rig, LATCHED)
        self.create_subscription(String, "replay_status", self._on_status, LATCHED)
        self.create_service(Trigger, "~/finish", self._on_finish)

    def _speak(self) -> None:
        self._residuals = self.create_publisher(PushResidual, "push_residual", 100)
        self._markers = self.create_publisher(MarkerArray, "push_markers", 10)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        steady = Clock(clock_type=ClockType.STEADY_TIME)  # goes on while /clock stands still
        self.create_timer(PERIOD, self._work, clock=steady)
        self.create_timer(self._values["diagnostics_period"], self._publish_diagnostics, clock=steady)

    def _sensor(self, kind: type, topic: str, inbox: Inbox[Any]) -> Subscription:
        return self.create_subscription(
            kind,
            topic,
            inbox.put,
            QoSProfile(depth=1000),
            qos_overriding_options=QoSOverridingOptions.with_default_policies(),
        )

    def close(self) -> None:
        """Write what was measured and is not on disk yet; publish the last diagnostics."""
        if not self._written:
            self._finish(with_report=False)
        self._publish_diagnostics()

    # --- what arrives ---------------------------------------------------------------------------------------

    def _on_rig(self, message: String) -> None:
        if self._values["rig"]:
            return
        try:
            self._rig = rig_from_json(message.data, "topic rig")
        except RigError as error:
            self._note(str(error))

    def _on_status(self, message: String) -> None:
        self._finished = message.data == "finished"

    def _on_finish(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._drain()
        try:
            self._finish(with_report=self._values["report"])
            response.success, response.message = True, self._values["output"] or "no folder: output is not set"
        except PushPredictorError as error:
            response.success, response.message = False, str(error)
        return response

    def _drain(self) -> None:
        """Take what the middleware holds at once: an executor's turn per message costs ten times the message."""
        for sensor, inbox in zip(self._sensors, (self._slider, self._pusher, self._wrench), strict=True):
            with sensor.handle:
                while (taken := sensor.handle.take_message(sensor.msg_type, sensor.raw)) is not None:
                    inbox.put(taken[0])

    # --- the work -------------------------------------------------------------------------------------------

    def _work(self) -> None:
        self._drain()
        if not self._ready():
            return
        self._feed()
        self._client.work()
        quiet = monotonic() - self._last_sample > QUIET
        if self._finished and quiet and not self._written:
            self._end_windows()
            if not self._client.open or monotonic() - self._last_sample > QUIET + LAST_ANSWERS:
                self._write(with_report=self._values["report"])

    def _ready(self) -> bool:
        """Whether models and rig are known; until then the samples wait in their inboxes."""
        if self._session is None and (models := self._source.models()) is not None:
            self._session = LiveValidation(models)
        if self._finder is None and self._session is not None and self._rig is not None:
            self._finder = WindowFinder(self._rig, window_options(self._session.models[0]))
        return self._finder is not None

    def _feed(self) -> None:
        slider, pusher, wrench = self._slider.take(), self._pusher.take(), self._wrench.take()
        if self._finder is None or not (slider or pusher or wrench):
            return
        self._last_sample = monotonic()
        if self._written:
            self._begin()
        self._finder.add_wrench(wrench_stream(wrench))
        self._finder.add_pusher(pose_stream(pusher))
        self._finder.add_slider(pose_stream(slider))
        self._ask_about(self._finder.take_ready())

    def _begin(self) -> None:
        """The first samples, or the first after an end: a new score."""
        if self._session is not None:
            self._session = LiveValidation(self._session.models)
        self._written, self._refused, self._reason = False, 0, ""

    def _ask_about(self, windows: Sequence[PushWindow]) -> None:
        if self._session is None:
            return
        for window in windows:
            number = self._session.add(window)
            for k, model in enumerate(self._session.models):
                request = query_to_request(
                    model.name, np.array([window.velocity, window.contact, window.angle]), window.duration
                )
                self._client.ask(request, self._answer_to(self._session, k, number))

    def _answer_to(self, session: LiveValidation, model: int, number: int) -> Callable[[PredictPush.Response], None]:
        def take(response: PredictPush.Response) -> None:
            try:
                prediction = prediction_from_response(response)
            except RefusedError as error:
                self._refused += 1
                self._note(str(error))
                return
            session.record(model, number, prediction)
            self._show(session, model, number, prediction)

        return take

    def _show(self, session: LiveValidation, model: int, number: int, prediction: Prediction) -> None:
        window = session.windows[number]
        residual = residual_to_message(_validated(session.models[model].name, window, prediction))
        self._residuals.publish(residual)
        if self._recorder is not None:
            self._recorder.add(residual, window.end)
        if model == 0 and self._rig is not None and self._markers.get_subscription_count():
            self._markers.publish(_markers(self._rig, window, prediction))

    # --- the end --------------------------------------------------------------------------------------------

    def _finish(self, with_report: bool) -> None:
        self._end_windows()
        self._write(with_report)

    def _end_windows(self) -> None:
        if self._finder is not None:
            self._ask_about(self._finder.finish())
            self._client.work()

    def _write(self, with_report: bool) -> None:
        """Write the score. Windows without an answer are counted as missed, not guessed."""
        self._written = True
        missed = self._client.forget()
        if missed:
            self._note(f"{missed} requests were never answered by predict_push")
        if self._session is None or self._recorder is None:
            return
        written = self._session.write(self._recorder.folder)
        self._recorder.write()
        if with_report and self._session.predicted():
            self._write_report(self._session)
        self.get_logger().info(f"validation written: {', '.join(map(str, written))}")

    def _write_report(self, session: LiveValidation) -> None:
        from push_predictor.evaluation.offline import report_windows

        if self._recorder is None:
            return
        comparisons = [session.comparison(k) for k in range(len(session.models))]
        report_windows(session.models, session.predicted(), comparisons, self._recorder.folder, "online validation")

    # --- diagnostics ----------------------------------------------------------------------------------------

    def _note(self, reason: str) -> None:
        if reason != self._reason:
            self.get_logger().warning(reason)
        self._reason = reason

    def _publish_diagnostics(self) -> None:
        level, message = self._health()
        status = diagnostic_status(self.get_fully_qualified_name(), level, message, self._figures())
        self._diagnostics.publish(diagnostic_array(self.get_clock().now().nanoseconds, status))

    def _health(self) -> tuple[Level, str]:
        if self._session is None:
            return Level.WARN, self._source.problem or "waiting for predict_server to tell about the model"
        if self._rig is None:
            return Level.WARN, self._reason or "waiting for the topic rig; or give the parameter rig"
        if not self._client.server_is_there:
            return Level.WARN, "predict_push is not offered by anybody"
        if self._reason:
            return Level.WARN, self._reason
        return Level.OK, "validating" if not self._written else "waiting for samples"

    def _figures(self) -> dict[str, Any]:
        inboxes = (("slider", self._slider), ("pusher", self._pusher), ("wrench", self._wrench))
        figures: dict[str, Any] = {f"{name} samples": inbox.received for name, inbox in inboxes}
        figures |= {f"{name} rejected": inbox.rejected for name, inbox in inboxes}
        figures |= {f"streams {kind}": count for kind, count in (self._finder.counts if self._finder else {}).items()}
        figures |= {"open requests": self._client.open, "timeouts": self._client.timeouts, "refused": self._refused}
        for k in range(len(self._session.models) if self._session else 0):
            figures |= self._score(k)
        return figures

    def _score(self, k: int) -> dict[str, Any]:
        assert self._session is not None
        name, score = self._session.models[k].name, metrics_json(self._session.comparison(k))
        figures: dict[str, Any] = {f"{name} windows": score["n_test"], f"{name} pushes": score["n_pushes"]}
        for key in ("nmse", "nlpd"):
            values = score[key]
            assert isinstance(values, dict)
            figures[f"{name} {key}"] = values["total"]
        levels = score["coverage"]
        assert isinstance(levels, dict)
        for output, share in (levels["0.95"] or {}).items():
            figures[f"{name} coverage 0.95 {output}"] = share
        return figures


def _validated(model: str, window: PushWindow, prediction: Prediction) -> ValidatedWindow:
    return ValidatedWindow(
        window.end,
        window.push_id,
        window.index,
        model,
        np.array([window.velocity, window.contact, window.angle]),
        window.duration,
        prediction.mean[0],
        prediction.covariance[0],
        window.displacement,
    )


def _markers(rig: Rig, window: PushWindow, prediction: Prediction) -> MarkerArray:
    heading = np.array(window.push_heading)
    shift = rotate(prediction.mean[0, :2], heading)
    predicted = window.slider_start + np.append(shift, prediction.mean[0, 2])
    turn = rotate(np.eye(2), heading).T
    covariance = turn @ prediction.covariance[0, :2, :2] @ turn.T
    return prediction_markers(
        rig.outline.vertices, window.slider_start, predicted, covariance, window.slider_end, "world", window.end
    )


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until SIGINT or SIGTERM; answers the exit status."""
    return run("push_validator", lambda stop: _made(stop), args)


def _made(stop: Stop) -> PushValidator:
    return PushValidator()


if __name__ == "__main__":
    sys.exit(main())
