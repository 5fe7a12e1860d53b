# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The node that compares predictions and outcomes while pushes happen or are replayed (docs/reference)."""

from __future__ import annotations

import sys

if __name__ == "__main__":  # before the other imports: they take half a second, in which a signal may arrive
    from push_predictor.nodes import entry

    sys.exit(entry.push_validator())

from collections.abc import Sequence
from time import monotonic

from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from push_predictor.errors import PushPredictorError
from push_predictor.evaluation.alarm.evidence import AlarmState, checked_rate
from push_predictor.nodes.parameter_tables import PUSH_VALIDATOR
from push_predictor.nodes.parameters import declare, values_of
from push_predictor.nodes.qos import LATCHED
from push_predictor.nodes.rig_source import RigSource
from push_predictor.nodes.runtime import run
from push_predictor.nodes.validator.finish_service import FinishService
from push_predictor.nodes.validator.results import ResultPublishers, ResultWriter
from push_predictor.nodes.validator.sensor_subscriber import SensorSubscriber
from push_predictor.nodes.validator.server_client import ModelSource, PredictionClient
from push_predictor.nodes.validator.status import StatusPublisher
from push_predictor.nodes.validator.validation_run import ValidationRun
from push_predictor.online.alarm_process import AlarmProcess
from push_predictor.online.session import Session, State
from push_predictor.recordings.topics import topics_of
from push_predictor_interfaces.msg import ReplayStatus

REPLAY_STATES = {ReplayStatus.PLAYING: "playing", ReplayStatus.PAUSED: "paused", ReplayStatus.FINISHED: "finished"}
PERIOD = 0.02  # s between two looks at what has arrived


class PushValidator(Node):
    """Finds windows in the sensor topics, requests a prediction of each from predict_push, and scores the answers.

    The executor's thread does all work, every PERIOD. Raises PushPredictorError for a bad parameter.
    """

    def __init__(self) -> None:
        super().__init__("push_validator")
        declare(self, PUSH_VALIDATOR)
        values = values_of(self, PUSH_VALIDATOR)
        self._closing = self._closed = False
        self._results = ResultPublishers(self, self._world)
        self._alarm = AlarmProcess(checked_rate(values["false_alarm_rate"]), self._on_alarm)
        self._models = ModelSource(self, [values["model"], *values["compare"]])
        self._rigs = RigSource(self, values["rig"])
        self._writer = ResultWriter(values["output"], self.get_logger())
        self._sensors = SensorSubscriber(self, topics_of(values))
        self._client = PredictionClient(self, values["request_timeout"])
        self._session = Session(values["last_answers"], values["report"])
        self._status = StatusPublisher(
            self, self._session, self._models, self._rigs, self._sensors, self._client, self._writer
        )
        self._strict: bool = values["strict"]
        self._run: ValidationRun | None = None  # the present one, or the last
        self.create_subscription(ReplayStatus, "replay_status", self._on_replay_status, LATCHED)
        self._finish = FinishService(self, self._session, self._models, self._rigs, self._writer)
        steady = Clock(clock_type=ClockType.STEADY_TIME)  # goes on while /clock stands still
        self.create_timer(PERIOD, self._work, clock=steady)
        self.create_timer(values["diagnostics_period"], lambda: self._status.publish(self._run), clock=steady)

    def finish(self) -> bool:
        """Write the results; whether that is done."""
        self._closing = True
        return self._closed

    def close(self) -> None:
        """End what runs, answer the last callers. Raises PushPredictorError if the results could not be written."""
        self._writer.close()
        self._alarm.stop()
        if self._run is None:
            self.get_logger().warning(self._status.why_nothing())
        else:
            self._run.checks.check.stop()
        self._sensors.close()
        self._finish.work()  # of calls since the last turn
        self._finish.answer()
        if self._session.failure:
            raise PushPredictorError(self._session.failure)

    def _world(self) -> str:
        """The frame in which the poses are."""
        return self._sensors.world

    def _on_replay_status(self, message: ReplayStatus) -> None:
        self._sensors.drain()
        self._session.replay(REPLAY_STATES.get(message.state, ""), samples_waiting=len(self._sensors) > 0)

    def _on_alarm(self, state: AlarmState, end: int) -> None:
        """Publish an alarm about the main model of the present run."""
        if self._run is not None:
            self._results.alarm(self._run.validation.names[0], state, end)

    def _work(self) -> None:
        if self._closed:
            return
        if self._closing:
            self._session.shut_down(monotonic())
        self._finish.work()  # before the samples: those that came before a call belong to its run
        self._sensors.look()
        self._sensors.drain()
        self._models.work()
        if (models := self._models.models()) is not None:
            self._alarm.prepare(next(iter(models.values())))
        self._alarm.work()
        self._rigs.work()  # before the samples that came after it
        self._advance()
        if self._run is not None:
            self._run.checks.work()
        if self._session.over:
            self._writer.close()  # or the callers of ~/finish would wait for a report that is not completed
            self._status.publish(self._run)
            self._closed = True
        self._finish.answer()

    def _advance(self) -> None:
        """Let the session go through its states: open, drain, write."""
        if not self._session.active:
            self._open()
        if self._session.state is State.OPEN and self._run is not None:
            other_rig = self._rigs.rig is not self._run.rig
            if not other_rig:
                self._feed(self._run)
            if self._session.drain_if_due(monotonic(), self._finish.requested, other_rig):
                self._finish.ending()
                self._run.finish({} if other_rig else self._sensors.last_scalars())
        self._client.work()
        if self._session.state is State.DRAINING and self._run is not None:
            self._drain(self._run)

    def _open(self) -> None:
        """Begin a run once models and rig are known; until then the samples wait."""
        models, rig, complete = self._models.models(), self._rigs.rig, self._sensors.complete()
        if models is None or rig is None or not len(self._sensors):
            return
        # A recording gives the finder every stream from its beginning, so a run begins with all of them.
        if complete or self._closing or self._finish.requested:
            output, scalars = self._writer.folder, list(self._sensors.decoder.scalars)
            if self._run is not None:
                self._run.checks.check.stop()
            self._sensors.decoder.begin(rig)
            results = self._results.publish, self._world
            self._run = ValidationRun(rig, models, self._client, *results, self._alarm, output, scalars, self._strict)
            self._session.open(monotonic())

    def _feed(self, current: ValidationRun) -> None:
        if not len(self._sensors):
            return
        samples = self._sensors.take()
        if len(samples):
            self._session.sample(monotonic())
        current.feed(samples)
        self._writer.warn_of_interrupted(current)

    def _drain(self, ending: ValidationRun) -> None:
        """Write the run once every answer is there or the patience is over."""
        if not self._session.answers_settled(monotonic(), self._client.open):
            return
        ending.pass_to_alarm(last=True)
        if not self._session.alarm_settled(monotonic(), self._alarm.busy):
            return
        self._client.forget()
        if failure := self._writer.write(ending, self._session.with_report):
            self._session.failed(failure)
        else:
            self._session.written()


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until SIGINT or SIGTERM; returns the exit status."""
    return run("push_validator", lambda stop: PushValidator(), args)
