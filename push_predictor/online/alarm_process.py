"""The alarm of a validator: complete pushes go to a process of its own, which answers what the evidence is.

Judging a push takes tenths of a second, and the training pushes some seconds more: as long as a queue of samples holds.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess

import numpy as np

from push_predictor.errors import RequestError
from push_predictor.evaluation.alarm.evidence import AlarmState, alarm_json
from push_predictor.evaluation.alarm.scores import AlarmMonitor, calibrate
from push_predictor.models.push_model import PushModel
from push_predictor.recordings.table import PushTable, concatenate
from push_predictor.types import Array

NICENESS = 5  # a sensor's queue must not wait for the alarm


@dataclass(frozen=True, eq=False)
class JudgedPush:
    """The windows of one push, what was predicted for them (n, 3), (n, 3, 3), and its end (ns)."""

    windows: PushTable
    mean: Array
    covariance: Array
    end: int


@dataclass(frozen=True, eq=False)
class _Answer:
    """Of the process: the state, the end (ns) of the push if it fired at one, and why pushes were left out."""

    score: int
    state: AlarmState | None = None
    fired: int | None = None
    off: str = ""
    skipped: tuple[str, ...] = ()


class PushAlarm:
    """The alarm about one model, score after score. fire: called once a score, with the state and the end of the push.

    Call `work` often, from the executor's thread.
    """

    def __init__(self, rate: float, fire: Callable[[AlarmState, int], None]) -> None:
        self._rate, self._fire = rate, fire
        self._model: PushModel | None = None
        self._process: BaseProcess | None = None
        self._connection: Connection | None = None
        self._waiting: list[JudgedPush] = []
        self._asked = False
        self._score = 0
        self.state: AlarmState | None = None
        self.off = "the training pushes are being judged"
        self.skipped: list[str] = []

    @property
    def busy(self) -> bool:
        """Are there pushes that were not judged yet?"""
        return bool(self._waiting or self._asked) and self._process is not None

    @property
    def json(self) -> dict[str, object]:
        """The field `alarm` of the result."""
        return alarm_json(self.state, self.off or "no push was judged")

    def prepare(self, model: PushModel) -> None:
        """Have the training pushes of a model judged; nothing happens if they are."""
        if model is self._model:
            return
        self.stop()
        self._model = model
        # spawned: a fork would inherit the threads' locks of the middleware
        context = multiprocessing.get_context("spawn")
        self._connection, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs, model, self._rate), daemon=True, name="alarm")
        self._process.start()
        theirs.close()
        self._asked = True  # the process speaks first

    def begin(self) -> None:
        """A new score: the pushes before are forgotten."""
        self._score += 1
        self._waiting, self.state, self.skipped = [], None, []

    def add(self, push: JudgedPush) -> None:
        """Take a push of which every window was answered or refused."""
        if self._process is not None:
            self._waiting.append(push)

    def work(self) -> None:
        """Hand over what waits, take what was answered."""
        try:
            while self._connection is not None and self._connection.poll():
                self._asked = False
                self._take(self._connection.recv())
            if self._connection is not None and self._waiting and not self._asked:
                self._connection.send((self._score, self._waiting))
                self._waiting, self._asked = [], True
        except (EOFError, OSError):
            self.stop()
            self.off = "the process of the alarm ended"

    def stop(self) -> None:
        """End the process."""
        if self._process is not None:
            self._process.terminate()
            self._process.join()
        self._process, self._connection, self._asked, self._waiting = None, None, False, []

    def _take(self, answer: _Answer) -> None:
        self.off = answer.off
        if self.off:
            self.stop()
        if answer.score != self._score:
            return
        self.skipped += answer.skipped
        self.state = answer.state or self.state
        if answer.fired is not None and self.state is not None:
            self._fire(self.state, answer.fired)


def _serve(connection: Connection, model: PushModel, rate: float) -> None:
    """The process: judges the training pushes, then every batch of pushes that comes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole group; the node ends this process
    os.nice(NICENESS)
    try:
        calibration = calibrate(model)
    except RequestError as error:
        connection.send(_Answer(0, off=str(error)))
        return
    connection.send(_Answer(0))
    monitor, current = AlarmMonitor(calibration, rate), 0
    try:
        while True:
            score, pushes = connection.recv()
            if score != current:
                monitor, current = AlarmMonitor(calibration, rate), score
            connection.send(_answer(monitor, score, pushes))
    except (EOFError, OSError):
        return  # the node has ended


def _answer(monitor: AlarmMonitor, score: int, pushes: list[JudgedPush]) -> _Answer:
    before = len(monitor.skipped)
    mean, covariance = np.concatenate([p.mean for p in pushes]), np.concatenate([p.covariance for p in pushes])
    fired = monitor.add(concatenate([p.windows for p in pushes]), mean, covariance)
    end = next((p.end for p in pushes if p.windows.pushes[0] == fired), None)
    return _Answer(score, monitor.state, end, skipped=tuple(monitor.skipped[before:]))
