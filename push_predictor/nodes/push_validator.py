"""The node that compares predictions with live or replayed pushes (docs/reference/push_validator.md)."""

from __future__ import annotations

import sys
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from time import monotonic

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from std_msgs.msg import String
from visualization_msgs.msg import MarkerArray

from msg_adapters.alarms import alarm_to_message
from msg_adapters.diagnostics import diagnostic_array
from push_predictor.errors import PushPredictorError, RequestError, RigError
from push_predictor.evaluation.alarm.evidence import DEFAULT_RATE, AlarmState, checked_rate
from push_predictor.models.push_model import Prediction
from push_predictor.nodes.parameters import Param, declare, values_of
from push_predictor.nodes.polling import DeferredTrigger, PolledGroup, take_all
from push_predictor.nodes.qos import LATCHED
from push_predictor.nodes.runtime import Stop, one_line, run
from push_predictor.nodes.validator.model_source import ModelSource
from push_predictor.nodes.validator.prediction_client import PredictionClient
from push_predictor.nodes.validator.residual_recorder import ResidualJournal
from push_predictor.nodes.validator.sensor_subscriber import SensorSubscriber
from push_predictor.nodes.validator.status import fired_text, validator_status
from push_predictor.nodes.validator.validation_run import ValidationRun
from push_predictor.nodes.validator.window_markers import window_markers
from push_predictor.online.alarm_process import PushAlarm as AlarmProcess
from push_predictor.online.report_process import ReportWriter
from push_predictor.recordings.rig import Rig, load_rig, rig_from_json
from push_predictor.recordings.windows.push_window import PushWindow
from push_predictor_interfaces.msg import PushAlarm, PushResidual

PERIOD = 0.02  # s between two looks at what has arrived
QUIET = 0.3  # s without samples after which a finished replay has delivered all it will
CALLER_PATIENCE = 5.0  # s that a caller of ~/finish waits for answers that are missing
SILENCE = 5.0  # s without samples after which a replay that was not paused must be thought to have died
LAST_PATIENCE = 2.0  # s that the end of the process waits for them
ALARM_PATIENCE = 15.0  # s that the end of a score waits for the alarm about the pushes that were answered
PARAMETERS = (
    Param("model", "", "The model judged: a model file, or a name that predict_server knows; empty: its default."),
    Param("compare", [""], "Further models judged on the same windows: files or names."),
    Param("rig", "", "A push_rig record (YAML file); empty: what the topic rig says."),
    Param("output", "", "Folder for validation.json, windows.json, the recording of residuals and the report."),
    Param("report", True, "Write the HTML report too, when a recording has finished or ~/finish is called."),
    Param("frame_id", "world", "The frame that sensor messages must name, others are rejected; empty: any."),
    Param(
        "scalar_topics", [""], "Scalar topics beside the sensors, by name; each window gets their values at its start."
    ),
    Param("request_timeout", 2.0, "Seconds after which an unanswered request is sent again.", low=0.05, high=60.0),
    Param(
        "last_answers",
        30.0,
        "Seconds that the end of a recording waits for answers that are missing.",
        low=0.0,
        high=3600.0,
    ),
    Param("false_alarm_rate", DEFAULT_RATE, "Probability, at most, that push_alarm ever comes without a change."),
    Param("diagnostics_period", 1.0, "Seconds between two messages on /diagnostics.", low=0.1, high=60.0),
)


@dataclass(frozen=True)
class _Ending:
    """A score that is about to be written: waiting for answers until the deadline."""

    deadline: float
    with_report: bool


class PushValidator(Node):
    """Finds windows in the sensor topics, asks predict_push about each, and keeps the score.

    All work is done in the executor's thread, every PERIOD. Raises PushPredictorError for a bad parameter.
    """

    def __init__(self, stop: Stop) -> None:
        super().__init__("push_validator")
        declare(self, PARAMETERS)
        self._values = values_of(self, PARAMETERS)
        self._stop = stop
        self._alarm = AlarmProcess(checked_rate(self._values["false_alarm_rate"]), self._on_alarm)
        self._source = ModelSource(self, [self._values["model"], *self._values["compare"]])
        self._rig: Rig | None = load_rig(Path(self._values["rig"]).expanduser()) if self._values["rig"] else None
        self._rig_problem = "" if self._rig else "waiting for the topic rig; or give the parameter rig"
        self._output = _folder(self._values["output"])
        self._inlet = SensorSubscriber(self, self._values["frame_id"], self._values["scalar_topics"])
        self._client = PredictionClient(self, self._values["request_timeout"])
        self._report = ReportWriter()
        self._run: ValidationRun | None = None  # the present score, or the last one
        self._open = False  # has the score something that was not written yet?
        self._ending: _Ending | None = None
        self._failure = ""
        self._said: list[str] = []  # problems that were logged
        self._written = False
        self._finished = self._paused = False  # the replay said so
        self._journal: ResidualJournal | None = None  # of the present score
        self._last_sample = monotonic()
        self._closing, self._closed = threading.Event(), threading.Event()
        self._listen()
        self._speak()

    def _listen(self) -> None:
        self._rigs = self.create_subscription(String, "rig", self._on_rig, LATCHED, callback_group=PolledGroup())
        self.create_subscription(String, "replay_status", self._on_status, LATCHED)
        self._finish = DeferredTrigger(self, "~/finish")

    def _speak(self) -> None:
        self._residuals = self.create_publisher(PushResidual, "push_residual", 1000)
        self._alarms = self.create_publisher(PushAlarm, "push_alarm", LATCHED)
        self._markers = self.create_publisher(MarkerArray, "push_markers", 100)  # for a burst after a stall
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        steady = Clock(clock_type=ClockType.STEADY_TIME)  # goes on while /clock stands still
        self.create_timer(PERIOD, self._work, clock=steady)
        self.create_timer(self._values["diagnostics_period"], self._publish_diagnostics, clock=steady)

    def close(self) -> None:
        """Have what was measured written; publish the last diagnostics. Raises PushPredictorError if it cannot be."""
        self._closing.set()
        while not self._closed.wait(0.1) and self._stop.error is None:
            pass
        self._report.stop()
        self._alarm.stop()
        self._inlet.close()
        if self._failure:
            raise PushPredictorError(self._failure)

    # --- what arrives ---------------------------------------------------------------------------------------

    def _on_rig(self, message: String) -> None:
        if self._values["rig"]:
            return
        try:
            self._rig, self._rig_problem = rig_from_json(message.data, "topic rig"), ""
        except RigError as error:
            self._rig_problem = str(error)

    def _on_status(self, message: String) -> None:
        self._inlet.drain()
        # With nothing measured it is old news: the state of a replay that ended before this node began.
        self._finished = message.data == "finished" and (self._open or len(self._inlet) > 0)
        self._paused = message.data == "paused"

    # --- the work -------------------------------------------------------------------------------------------

    def _work(self) -> None:
        if self._closed.is_set():
            return  # close() ends what works here, from another thread
        self._inlet.look()
        self._inlet.drain()
        self._source.work()
        if (models := self._source.models()) is not None:
            self._alarm.prepare(next(iter(models.values())))
        self._alarm.work()
        for message, *_ in take_all(self._rigs):  # before the samples that came after it
            self._on_rig(message)
        if self._ending is None:
            self._collect()
            self._ending = self._due()
            if self._ending is not None and self._run is not None:
                self._run.finish({} if self._rig_changed() else self._inlet.last_scalars())
        self._client.work()
        if self._ending is not None:
            self._end(self._ending)
        self._answer_callers()
        if self._closing.is_set() and not self._open:
            self._publish_diagnostics()
            self._closed.set()

    def _collect(self) -> None:
        """Feed the score with what has arrived; until models and rig are known, the samples wait."""
        models, complete = self._source.models(), self._inlet.complete()
        if models is None or self._rig is None or not len(self._inlet) or self._rig_changed():
            return
        if not self._open:
            # Reading a recording gives the finder every stream from its beginning, so a score begins with all of them.
            if not (complete or self._closing.is_set() or self._finish.asked()):
                return
            scalars = self._inlet.scalar_names
            self._run = ValidationRun(
                self._rig, models, self._client, self._on_answer, self._alarm, self._output, scalars
            )
            self._journal = ResidualJournal(self._output) if self._output else None
            self._open, self._failure = True, ""
        samples = self._inlet.take()
        if len(samples):
            self._last_sample = monotonic()
        if self._run is not None:
            self._run.feed(samples)
            self._tell_of_cut_off(self._run)

    def _tell_of_cut_off(self, begun: ValidationRun) -> None:
        """An earlier score that was cut off lies where the new one is to be: say what was saved, and what it lacks."""
        if begun.table is None or begun.table.cut_off is None:
            return
        self.get_logger().warning(
            f"an earlier score was cut off: its windows and residuals so far are in {begun.table.cut_off}; it has no "
            "validation.json, windows.json, bag of residuals or report"
        )
        begun.table.cut_off = None

    def _rig_changed(self) -> bool:
        """Is the score of another rig than the one that is there now?"""
        if not self._open or self._run is None or self._rig is None or self._run.rig is self._rig:
            return False
        return self._run.rig.to_record() != self._rig.to_record()

    def _due(self) -> _Ending | None:
        """Is it time to end the score, and how?"""
        if not self._open:
            return None
        if self._closing.is_set():
            return _Ending(monotonic() + LAST_PATIENCE, with_report=False)
        if self._finish.asked():
            return _Ending(monotonic() + CALLER_PATIENCE, self._values["report"])
        if self._rig_changed():
            return _Ending(monotonic() + CALLER_PATIENCE, with_report=False)
        if self._finished and monotonic() - self._last_sample > QUIET:
            return _Ending(monotonic() + self._values["last_answers"], self._values["report"])
        return None

    def _end(self, ending: _Ending) -> None:
        """Write the score once every answer is there or the patience is over."""
        if self._closing.is_set():
            ending = self._ending = _Ending(min(ending.deadline, monotonic() + LAST_PATIENCE), with_report=False)
        if self._run is None or (self._client.open and monotonic() < ending.deadline):
            return
        self._run.no_more_answers()
        patience = 0.0 if self._closing.is_set() else ALARM_PATIENCE
        if self._alarm.busy and monotonic() < ending.deadline + patience:
            return
        self._client.forget()
        self._ending, self._finished, self._open = None, False, False
        try:
            self._write(self._run, ending.with_report)
        except (PushPredictorError, OSError) as error:
            self._open = not self._closing.is_set()  # ~/finish may try again
            self._failure = f"not written: {one_line(error)}"
            self.get_logger().error(self._failure)

    def _write(self, finished: ValidationRun, with_report: bool) -> None:
        validation = finished.validation
        for k, name in enumerate(validation.names):
            if missing := validation.unanswered(k):
                self.get_logger().warning(f"{name}: {missing} windows were never answered by predict_push")
        if self._output is None or (self._written and not len(validation.windows)):
            return  # samples without a push after an earlier end are no reason to replace its result
        written = finished.write(self._output)
        self._written, self._failure = True, ""
        self.get_logger().info(f"validation written: {', '.join(map(str, written))}")
        if with_report and len(validation.predicted()):
            self._report.start(validation, self._output)

    def _answer_callers(self) -> None:
        """Answer ~/finish when nothing is left to be done."""
        if self._ending is not None or self._report.busy or not self._finish.asked():
            return
        if problem := self._failure or self._hindrance():
            self._finish.answer(False, problem)
        elif self._report.failed:
            self._finish.answer(False, f"the result is in {self._output}, the report failed, see the log of the node")
        elif self._run is None:
            self._finish.answer(False, "no sample has come yet")
        else:
            self._finish.answer(True, str(self._output or "the parameter output is empty: nothing was written"))

    def _hindrance(self) -> str:
        """Why no score could begin, in words, empty if it could."""
        if self._source.models() is None:
            return "; ".join(self._source.problems) or "waiting for list_models of predict_server"
        return self._rig_problem if self._rig is None else ""

    # --- what is shown --------------------------------------------------------------------------------------

    def _on_answer(self, model: int, window: PushWindow, prediction: Prediction, residual: PushResidual) -> None:
        if self._journal is not None:
            self._journal.add(residual)
        self._show(model, window, prediction, residual)

    def _show(self, model: int, window: PushWindow, prediction: Prediction, residual: PushResidual) -> None:
        self._residuals.publish(residual)
        if model == 0 and self._rig is not None and self._markers.get_subscription_count():
            self._markers.publish(window_markers(self._rig, window, prediction, self._values["frame_id"] or "world"))

    def _on_alarm(self, state: AlarmState, end: int) -> None:
        self.get_logger().warning(fired_text(state))
        self._alarms.publish(alarm_to_message(state, end, self._values["frame_id"] or "world"))

    def _publish_diagnostics(self) -> None:
        unkept = self._journal.failure if self._journal else ""
        found = [*self._source.problems, self._hindrance(), self._rig_problem, unkept, self._silence()]
        problems = [*filter(None, dict.fromkeys(found))]
        if problems != self._said:
            self._said = problems
            for problem in problems:
                self.get_logger().warning(problem)
        status = validator_status(
            self.get_fully_qualified_name(),
            self._state(),
            self._run,
            self._inlet,
            self._client,
            problems,
            self._failure,
        )
        self._diagnostics.publish(diagnostic_array(self.get_clock().now().nanoseconds, status))

    def _silence(self) -> str:
        """Has whoever feeds the score fallen silent? In words, empty if not."""
        if not self._open or self._paused or self._ending or monotonic() - self._last_sample < SILENCE:
            return ""
        return f"no sample for over {SILENCE:g} s: the score is kept open, ~/finish has it written"

    def _state(self) -> str:
        if self._ending is not None:
            return "waiting for the last answers"
        if self._report.busy:
            return "writing the report"
        return "validating" if self._open else "waiting for samples"


def _folder(text: str) -> Path | None:
    """The output folder, made if need be: that it cannot be should be known before the measurement."""
    if not text:
        return None
    folder = Path(text).expanduser().absolute()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RequestError("output", text, f"a folder that can be written ({error.strerror})") from None
    return folder


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until SIGINT or SIGTERM; answers the exit status."""
    return run("push_validator", PushValidator, args)


if __name__ == "__main__":
    sys.exit(main())
