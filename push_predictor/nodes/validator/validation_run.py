"""One score: the windows found from first sample to end, what was asked about them, what was answered."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import isfinite
from pathlib import Path
from types import MappingProxyType

import numpy as np

from msg_adapters import MessageError
from msg_adapters.predictions import RefusedError, prediction_from_response, query_to_request
from push_predictor.evaluation.alarm.evidence import with_alarm
from push_predictor.evaluation.offline import window_options
from push_predictor.models.push_model import Prediction, PushModel
from push_predictor.nodes.validator.prediction_client import PredictionClient
from push_predictor.nodes.validator.residual_recorder import residual_message, write_residuals
from push_predictor.nodes.validator.sensor_subscriber import Samples
from push_predictor.nodes.validator.stream_sync import StreamPace
from push_predictor.nodes.validator.window_table import WindowTable
from push_predictor.online.alarm_process import PushAlarm
from push_predictor.online.completed_pushes import PushGate
from push_predictor.online.live_validation import MAIN_RESULT, LiveValidation
from push_predictor.recordings.atomic import write_whole
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import ScalarStream
from push_predictor.recordings.windows.finder import WindowFinder
from push_predictor.recordings.windows.push_window import PushWindow
from push_predictor_interfaces.msg import PushResidual
from push_predictor_interfaces.srv import PredictPush


class ValidationRun:
    """Feed it samples; it asks the client about every window and keeps the score.

    models: by the name to ask for, the main one first. show: called for every prediction, with the number of the model.
    alarm: about the main model. output: where the windows are kept while they come; None: nowhere. scalars: the topics
    that may come beside the sensors.
    """

    def __init__(
        self,
        rig: Rig,
        models: Mapping[str, PushModel],
        client: PredictionClient,
        show: Callable[[int, PushWindow, Prediction, PushResidual], None],
        alarm: PushAlarm | None = None,
        output: Path | None = None,
        scalars: Sequence[str] = (),
    ) -> None:
        self.rig = rig
        self.alarm = alarm
        self.table = WindowTable(output, rig) if output else None
        self.table_failure = ""
        self._gate = PushGate()
        self.validation = LiveValidation(models)
        self.refused = 0
        self.last_refusal = ""
        self._finder = WindowFinder(rig, window_options(self.validation.models[0]))
        self._client = client
        self._show = show
        self._pace = StreamPace(scalars)
        self._first: dict[str, float] = {}  # value of each scalar, by the name of its covariate
        if alarm is not None:
            alarm.begin()

    @property
    def counts(self) -> dict[str, int]:
        """What the window finder met in the streams."""
        return self._finder.counts

    @property
    def pace(self) -> StreamPace:
        """How the streams stand to each other."""
        return self._pace

    def feed(self, samples: Samples) -> None:
        """Take a portion of the streams."""
        self._add_scalars(samples.scalars)
        self._finder.add_wrench(samples.wrench)
        self._finder.add_pusher(samples.pusher)
        self._finder.add_slider(samples.slider)
        self._pace.note(samples)
        if self._pace.in_step():
            self._ask_about(self._finder.take_ready())

    def finish(self, scalars: Mapping[str, ScalarStream] = MappingProxyType({})) -> None:
        """No more samples will come but these."""
        self._add_scalars(scalars)
        self._ask_about(self._finder.finish())

    def no_more_answers(self) -> None:
        """What was not answered will not be: the last pushes go to the alarm."""
        self._judge(last=True)

    def write(self, folder: Path) -> list[Path]:
        """Write the JSON, the main model's with the alarm, and the residuals. Raises OSError or RecordingError."""
        written = [*self.validation.write(folder), write_residuals(self.validation, folder)]
        if self.alarm is not None:
            path = folder / MAIN_RESULT
            write_whole(path, with_alarm(path.read_text(), self.alarm.json).encode())
        return written

    def _judge(self, last: bool = False) -> None:
        for push in self._gate.passed(last):
            if self.alarm is not None:
                self.alarm.add(push)

    def _add_scalars(self, scalars: Mapping[str, ScalarStream]) -> None:
        for name, stream in scalars.items():
            self._finder.add_scalar(name, stream)
            if len(stream):
                self._first.setdefault(f"topic:{name}", float(stream.value[0]))

    def _ask_about(self, windows: Sequence[PushWindow]) -> None:
        self._keep(windows)
        for window in windows:
            number = self.validation.add(window)
            self._gate.found(number, window)
            push = np.array([window.velocity, window.contact, window.angle])
            known = {name: value for name, value in window.covariates.items() if isfinite(value)}
            for model, name in enumerate(self.validation.names):
                request = query_to_request(name, push, window.duration, known)
                self._client.ask(request, self._taking(model, number))

    def _keep(self, windows: Sequence[PushWindow]) -> None:
        """Put the windows on disk; that this fails does not end the measurement."""
        if self.table is None or self.table_failure:
            return
        try:
            self.table.add(windows, self.validation.windows, self._first)
        except OSError as error:
            self.table_failure = f"windows are not kept: {error}"

    def _taking(self, model: int, number: int) -> Callable[[PredictPush.Response], None]:
        return lambda response: self._take(model, number, response)

    def _take(self, model: int, number: int, response: PredictPush.Response) -> None:
        window, name = self.validation.windows[number], self.validation.names[model]
        try:
            prediction = _usable(prediction_from_response(response))
            residual = residual_message(name, window, prediction.mean[0], prediction.covariance[0])
        except (RefusedError, MessageError) as error:
            self.refused += 1
            self.last_refusal = f"{name}: {error}"
            self.validation.refuse(model, number, str(error))
            self._settle(model, number, window, None)
            return
        self.validation.record(model, number, prediction)
        self._settle(model, number, window, prediction)
        self._show(model, window, prediction, residual)

    def _settle(self, model: int, number: int, window: PushWindow, prediction: Prediction | None) -> None:
        if model == 0:
            self._gate.answered(number, window, prediction)
            self._judge()


def _usable(prediction: Prediction) -> Prediction:
    """Raises MessageError for a number that is not finite."""
    for name, values in (("mean", prediction.mean), ("covariance", prediction.covariance)):
        if not np.all(np.isfinite(values)):
            raise MessageError(f"response {name}", values.ravel().tolist(), "finite numbers")
    return prediction
