# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""The states of a validation run: waiting for samples, open, draining (answers are awaited), written."""

from __future__ import annotations

from enum import Enum
from math import inf

QUIET = 0.3  # s without samples after which a finished replay has delivered everything
SILENCE = 5.0  # s without samples after which a replay that is not paused has probably died
CALLER_PATIENCE = 5.0  # s that a caller of ~/finish waits for missing answers; also the end by another rig
SHUTDOWN_PATIENCE = 2.0  # s that the end of the process waits for them
ALARM_PATIENCE = 15.0  # s more that a run waits for the alarm to judge its answered pushes


class State(Enum):
    """WAITING: no sample yet. OPEN: samples are taken. DRAINING: answers are awaited. WRITTEN: the result is kept."""

    WAITING = "waiting"
    OPEN = "open"
    DRAINING = "draining"
    WRITTEN = "written"


class Session:
    """State, deadline and failure of the runs of one node, one after the other.

    last_answers: seconds that the end of a recording waits for missing answers. report: whether a run that ends
    by a finished replay or by a caller gets a report. Every `now` is a time of one monotonic clock, in seconds.
    """

    def __init__(self, last_answers: float, report: bool) -> None:
        self.state = State.WAITING
        self.failure = ""  # why the last result could not be written
        self.with_report = False  # whether the run that ends gets one
        self._last_answers, self._report = last_answers, report
        self._deadline, self._last_sample = inf, -inf
        self._finished = self._paused = self._shutting_down = False

    @property
    def active(self) -> bool:
        """Whether samples were taken that no result contains yet."""
        return self.state in (State.OPEN, State.DRAINING)

    @property
    def over(self) -> bool:
        """Whether the process may end: it shuts down, and nothing is left to write."""
        return self._shutting_down and not self.active

    def open(self, now: float) -> None:
        """Begin a run, from WAITING or WRITTEN."""
        assert not self.active
        self.state, self.failure, self._last_sample = State.OPEN, "", now

    def sample(self, now: float) -> None:
        """Note that samples arrived."""
        self._last_sample = now

    def replay(self, status: str, samples_waiting: bool) -> None:
        """Note a replay's status: playing, paused or finished."""
        # Without samples, "finished" is old news: the state of a replay that ended before this node began.
        self._finished = status == "finished" and (self.active or samples_waiting)
        self._paused = status == "paused"

    def shut_down(self, now: float) -> None:
        """Note that the process ends: no report, and little time for missing answers. Repeating it changes nothing."""
        self._shutting_down, self.with_report = True, False
        self._deadline = min(self._deadline, now + SHUTDOWN_PATIENCE)

    def drain_if_due(self, now: float, finish_requested: bool, rig_changed: bool) -> bool:
        """Go from OPEN to DRAINING if it is time; returns whether it was."""
        if self.state is not State.OPEN:
            return False
        if self._shutting_down:
            return self._drain(now + SHUTDOWN_PATIENCE, with_report=False)
        if finish_requested:
            return self._drain(now + CALLER_PATIENCE, self._report)
        if rig_changed:
            return self._drain(now + CALLER_PATIENCE, with_report=False)
        if self._finished and now - self._last_sample > QUIET:
            return self._drain(now + self._last_answers, self._report)
        return False

    def _drain(self, deadline: float, with_report: bool) -> bool:
        self.state, self._deadline, self.with_report = State.DRAINING, deadline, with_report
        return True

    def answers_settled(self, now: float, open_requests: int) -> bool:
        """Whether a draining run has all answers, or will not wait for more."""
        return not open_requests or now >= self._deadline

    def alarm_settled(self, now: float, busy: bool) -> bool:
        """Whether the alarm has judged the pushes of a draining run, or will not be waited for."""
        return not busy or now >= self._deadline + (0.0 if self._shutting_down else ALARM_PATIENCE)

    def written(self) -> None:
        """Go from DRAINING to WRITTEN."""
        self._end(State.WRITTEN, "")

    def failed(self, reason: str) -> None:
        """Go from DRAINING back to OPEN, where ~/finish may try again; at shutdown give the run up."""
        self._end(State.WRITTEN if self._shutting_down else State.OPEN, reason)

    def _end(self, state: State, failure: str) -> None:
        assert self.state is State.DRAINING
        self.state, self.failure, self._deadline, self._finished = state, failure, inf, False

    def silent(self, now: float) -> bool:
        """Whether an open run gets no samples though the replay is not paused."""
        return self.state is State.OPEN and not self._paused and now - self._last_sample >= SILENCE
