# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The alarm of a validator in a process of its own: takes completed pushes, returns the evidence.

Scoring a push takes tenths of a second, calibrating on the training pushes seconds: long enough to fill a sensor queue.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from push_predictor.evaluation.alarm.evidence import AlarmState, alarm_json
from push_predictor.evaluation.alarm.scores import AlarmMonitor, calibrate
from push_predictor.models.push_model import PushModel
from push_predictor.online.child_process import Child, Failure
from push_predictor.recordings.table import PushTable, concatenate
from push_predictor.types import Array

if TYPE_CHECKING:
    from multiprocessing.connection import Connection


@dataclass(frozen=True, eq=False)
class _Reply:
    """Of the process: state, end (ns) of the push if the alarm fired at one, why pushes were skipped."""

    run: int
    state: AlarmState | None = None
    fired: int | None = None
    skipped: tuple[str, ...] = ()


class AlarmProcess:
    """The alarm about one model, run after run. fire: called at most once a run, with state and end of the push.

    state: None until a push is scored. off: why there is no alarm, in words. skipped: pushes that could not be scored.
    Call `work` often, from the executor's thread.
    """

    def __init__(self, rate: float, fire: Callable[[AlarmState, int], None]) -> None:
        self._rate, self._fire = rate, fire
        self._model: PushModel | None = None
        self._child = Child("alarm", _work)
        self._waiting: list[CompletedPush] = []
        self._asked = False
        self._run = 0
        self.state: AlarmState | None = None
        self.off = "calibrating on the training pushes"
        self.skipped: list[str] = []

    @property
    def busy(self) -> bool:
        """Whether pushes are waiting to be scored."""
        return bool(self._waiting or self._asked)

    @property
    def json(self) -> dict[str, object]:
        """The field `alarm` of the result."""
        return alarm_json(self.state, self.off or "no push was scored")

    def prepare(self, model: PushModel) -> None:
        """Start the process, which calibrates on the training pushes of a model; does nothing for the same model."""
        if model is self._model:
            return
        self.stop()
        self._model = model
        self._child.start(model, self._rate)
        self._asked = True  # the process speaks first

    def begin(self) -> None:
        """Begin a run: forget the pushes of the last."""
        self._run += 1
        self._waiting, self.state, self.skipped = [], None, []

    def add(self, push: CompletedPush) -> None:
        """Take a push of which every window was predicted or refused."""
        if self._child.started:
            self._waiting.append(push)

    def work(self) -> None:
        """Send the pushes that wait, take the replies."""
        while (reply := self._child.received()) is not None:
            self._asked = False
            if isinstance(reply, Failure):
                self.stop()
                self.off = reply.reason
            else:
                self._take(reply)
        if self._waiting and not self._asked:
            self._child.send((self._run, self._waiting))
            self._waiting, self._asked = [], True

    def stop(self) -> None:
        """End the process."""
        self._child.stop()
        self._asked, self._waiting = False, []

    def _take(self, reply: _Reply) -> None:
        self.off = ""
        if reply.run != self._run:
            return
        self.skipped += reply.skipped
        self.state = reply.state or self.state
        if reply.fired is not None and self.state is not None:
            self._fire(self.state, reply.fired)


def _work(connection: Connection, model: PushModel, rate: float) -> None:
    """Calibrate on the training pushes, then score every batch of pushes that arrives; the process runs this."""
    calibration, current = calibrate(model), 0
    monitor = AlarmMonitor(calibration, rate)
    connection.send(_Reply(current))
    while True:
        run, pushes = connection.recv()
        if run != current:
            monitor, current = AlarmMonitor(calibration, rate), run
        connection.send(_reply(monitor, run, pushes))


def _reply(monitor: AlarmMonitor, run: int, pushes: list[CompletedPush]) -> _Reply:
    before = len(monitor.skipped)
    mean, covariance = np.concatenate([p.mean for p in pushes]), np.concatenate([p.covariance for p in pushes])
    fired = monitor.add(concatenate([p.windows for p in pushes]), mean, covariance)
    end = next((p.end for p in pushes if p.windows.pushes[0] == fired), None)
    return _Reply(run, monitor.state, end, skipped=tuple(monitor.skipped[before:]))


@dataclass(frozen=True, eq=False)
class CompletedPush:
    """The n answered windows of one push, their predictions (n, 3) and (n, 3, 3), and the push's end (ns)."""

    windows: PushTable
    mean: Array
    covariance: Array
    end: int
