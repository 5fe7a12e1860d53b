# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""One validation run: windows found from the first sample to the end, requests about them, answers to these."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from math import isfinite
from pathlib import Path
from types import MappingProxyType

import numpy as np
from rclpy.serialization import serialize_message

from msg_adapters.predictions import RefusedError, prediction_from_response, query_to_request
from msg_adapters.residuals import residual_to_message
from push_predictor.errors import RequestError
from push_predictor.evaluation.alarm.evidence import with_alarm
from push_predictor.evaluation.offline import window_options
from push_predictor.models.prediction import Prediction
from push_predictor.models.push_model import PushModel
from push_predictor.nodes.validator.server_client import PredictionClient
from push_predictor.online.alarm_process import AlarmProcess
from push_predictor.online.check_process import SampleCheck
from push_predictor.online.live_validation import MAIN_RESULT, LiveValidation
from push_predictor.online.run_files import JOURNAL, RunFiles
from push_predictor.online.stream_health import StreamSync
from push_predictor.recordings.atomic import write_whole
from push_predictor.recordings.bag.message_types import definition_text
from push_predictor.recordings.bag.writer import BagWriter
from push_predictor.recordings.checks.coverage import pushed_part
from push_predictor.recordings.checks.finding import Finding
from push_predictor.recordings.decoder.decoder import Samples
from push_predictor.recordings.rig import Rig
from push_predictor.recordings.streams import ScalarStream
from push_predictor.recordings.windows.finder import WindowFinder
from push_predictor.recordings.windows.push_window import PushWindow, windows_to_table
from push_predictor_interfaces.msg import PushResidual
from push_predictor_interfaces.srv import PredictPush

TOPIC, TYPE, BAG = "push_residual", "push_predictor_interfaces/msg/PushResidual", "residuals"


class ValidationRun:
    """Takes samples, requests a prediction for every window from the client, and scores the answers.

    models: by the name to request, the main one first. publish: called for every prediction, with rig and number of
    the model. world: returns the frame in which the poses are. alarm: of the main model. output: folder in which
    windows and residuals are saved as they arrive; None: they are not saved. scalars: the topics that may be published
    in addition to the sensors. strict: a warning about the samples is an error. finder: has met the faults of the
    streams.
    """

    def __init__(
        self,
        rig: Rig,
        models: Mapping[str, PushModel],
        client: PredictionClient,
        publish: Callable[[Rig, int, PushWindow, Prediction, PushResidual], None],
        world: Callable[[], str],
        alarm: AlarmProcess | None = None,
        output: Path | None = None,
        scalars: Sequence[str] = (),
        strict: bool = False,
    ) -> None:
        self.rig = rig
        self.alarm = alarm
        self.files = RunFiles(output, rig) if output else None
        self.validation = LiveValidation(models)
        self.sync = StreamSync(scalars)  # how far each stream has come
        self.checks = SampleCheck(rig, strict)
        self.coverage: list[Finding] | None = None  # what the windows leave out of the domain, known at the end
        self.refused = 0
        self.last_refusal = ""
        self.finder = WindowFinder(rig, window_options(self.validation.models[0]))
        self._client = client
        self._publish, self._world = publish, world
        self._first: dict[str, float] = {}  # value of each scalar, by the name of its covariate
        if alarm is not None:
            alarm.begin()

    def feed(self, samples: Samples) -> None:
        """Take a portion of the streams."""
        self._add_scalars(samples.scalars)
        self.finder.add_wrench(samples.wrench)
        self.finder.add_pusher(samples.pusher)
        self.finder.add_slider(samples.slider)
        self.sync.note(samples)
        self.checks.add(samples)
        if self.sync.in_step():
            self._request(self.finder.take_ready())

    def finish(self, scalars: Mapping[str, ScalarStream] = MappingProxyType({})) -> None:
        """Take the last scalars and find the last windows: no more samples will arrive."""
        self._add_scalars(scalars)
        self._request(self.finder.finish())
        if len(self.validation.windows):
            self.coverage = pushed_part(windows_to_table(self.validation.windows), self.rig)

    def write(self, folder: Path) -> list[Path]:
        """Write the JSON, the main model's with the alarm, and the residuals. Raises OSError or RecordingError."""
        written = [*self.validation.write(folder), write_residuals(self.validation, folder, self._world())]
        if self.alarm is not None:
            path = folder / MAIN_RESULT
            write_whole(path, with_alarm(path.read_text(), self.alarm.json).encode())
        return written

    def pass_to_alarm(self, last: bool = False) -> None:
        """Hand the complete pushes to the alarm; last: also those with windows that will not be answered."""
        for push in self.validation.completed(last):
            if self.alarm is not None:
                self.alarm.add(push)

    def _add_scalars(self, scalars: Mapping[str, ScalarStream]) -> None:
        for name, stream in scalars.items():
            self.finder.add_scalar(name, stream)
            if len(stream):
                self._first.setdefault(f"topic:{name}", float(stream.value[0]))

    def _request(self, windows: Sequence[PushWindow]) -> None:
        if self.files is not None:
            self.files.add(windows, self.validation.windows, self._first)
        for window in windows:
            number = self.validation.add(window)
            push = np.array([window.velocity, window.contact, window.angle])
            for model, name in enumerate(self.validation.names):
                request = query_to_request(name, push, window.duration, self._known(model, window))
                self._client.ask(request, partial(self._take, model, number))

    def _known(self, model: int, window: PushWindow) -> dict[str, float]:
        """The finite covariates of a window, with those that only grow counted as the model counts them."""
        columns = self.validation.models[model].continued(windows_to_table([window])).covariates
        return {name: float(column[0]) for name, column in columns.items() if isfinite(column[0])}

    def _take(self, model: int, number: int, response: PredictPush.Response) -> None:
        window, name = self.validation.windows[number], self.validation.names[model]
        try:
            prediction = _finite(prediction_from_response(response))
            mean, covariance, in_domain = prediction.mean[0], prediction.covariance[0], bool(prediction.in_domain[0])
            residual = residual_to_message(name, window, mean, covariance, in_domain, self._world())
        except (RefusedError, RequestError) as error:
            self.refused += 1
            self.last_refusal = f"{name}: {error}"
            self.validation.refuse(model, number, str(error))
        else:
            self.validation.record(model, number, prediction)
            if self.files is not None:
                self.files.add_residual(name, window, mean, covariance)
            self._publish(self.rig, model, window, prediction, residual)
        self.pass_to_alarm()


def write_residuals(validation: LiveValidation, folder: Path, frame_id: str) -> Path:
    """Write FOLDER/residuals, a rosbag2 folder, and remove the journal of the same residuals.

    One push_residual for each prediction of each model, at the window's end. frame_id: of the poses. Raises
    RecordingError.
    """
    path = folder / BAG
    with BagWriter(path) as bag:
        bag.add_topic(TOPIC, TYPE, definition_text(TYPE))
        for residual in validation.residuals():
            bag.write(TOPIC, residual.window.end, serialize_message(residual_to_message(*residual, frame_id)))
    (folder / JOURNAL).unlink(missing_ok=True)
    return path


def _finite(prediction: Prediction) -> Prediction:
    """The prediction. Raises RequestError for a number that is not finite."""
    for name, values in (("mean", prediction.mean), ("covariance", prediction.covariance)):
        if not np.all(np.isfinite(values)):
            raise RequestError(f"response {name}", values.ravel().tolist(), "finite numbers")
    return prediction
